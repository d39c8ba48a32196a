// A self-contained HTML page: text, tables and embedded pictures, readable in light and dark, no script, no network.
#pragma once
#include "base/error.h"
#include "base/text.h"

typedef struct alb_page {
    alb_text html;
} alb_page;

void alb_page_begin(alb_page *page, const char *title, const char *subtitle);
void alb_page_heading(alb_page *page, const char *text);
// printf format; the result is escaped.
void alb_page_paragraph(alb_page *page, const char *format, ...) __attribute__((format(printf, 2, 3)));
// A paragraph for every line of the text.
void alb_page_lines(alb_page *page, const char *text);
// A table: header cells separated by '|', then rows in the same way. Cells are escaped; numeric cells align right.
void alb_page_table(alb_page *page, const char *header);
void alb_page_row(alb_page *page, const char *format, ...) __attribute__((format(printf, 2, 3)));
void alb_page_end_table(alb_page *page);
// Pictures side by side: open, add each (PNG from a file as base64, or SVG text inline), close.
void alb_page_begin_pictures(alb_page *page);
bool alb_page_picture(alb_page *page, const char *path, const char *caption, alb_error *error); // .png or .svg file
void alb_page_svg(alb_page *page, const char *svg, const char *caption);
void alb_page_end_pictures(alb_page *page);
// Closes, writes atomically, frees.
bool alb_page_write(alb_page *page, const char *path, alb_error *error);
void alb_page_free(alb_page *page);
