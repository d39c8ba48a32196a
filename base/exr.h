// OpenEXR files by OpenEXRCore: single-part, flat, scan lines or tiles (level 0), any channel names; half, float and
// uint all become float32. The data window becomes the image.
#pragma once
#include "base/image.h"

bool alb_exr_is(const void *bytes, size_t size);
// Decodes the bytes of a file; `name` is for messages. Refuses deep data, multi-part files, subsampled channels, more
// than ALB_CHANNELS_MAX channels and damaged files. Channels are in the order R, G, B, Y, then the rest by name.
bool alb_exr_decode(alb_image *image, const void *bytes, size_t size, const char *name, alb_error *error);
// The same from a file.
bool alb_exr_read(alb_image *image, const char *path, alb_error *error);
// Float32, ZIP, atomically; `provenance` (may be NULL) becomes a string attribute of that name. Same input, same bytes.
bool alb_exr_write(const alb_image *image, const char *provenance, const char *path, alb_error *error);
