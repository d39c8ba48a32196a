// Text made safe inside SVG and HTML, as content or as a quoted attribute.
#pragma once
#include "base/text.h"

// Appends `plain` with & < > " ' escaped; control characters and bytes that are not UTF-8 become U+FFFD, so that the
// document stays well-formed whatever a file name holds. NULL adds nothing.
void alb_markup_add(alb_text *markup, const char *plain);
// Characters (code points) of a text, for layout; stray bytes count as one.
int alb_markup_length(const char *plain);
