// HTML5 pages in one file: style inline, pictures as data URIs (RFC 2397, base64 of RFC 4648), every text escaped.
// A picture costs 4/3 of its bytes in the page; nothing is fetched when the page is read.
#define _GNU_SOURCE // vasprintf
#include "base/page.h"

#include "base/file.h"
#include "base/markup.h"

#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char style[] =
    ":root{color-scheme:light dark;--ink:#1d1d1f;--quiet:#6a6a70;--line:#dcdce0;--ground:#fff;--soft:#f6f6f8}\n"
    "@media(prefers-color-scheme:dark){:root{--ink:#e8e8ea;--quiet:#9c9ca4;--line:#3a3a40;--ground:#18181b;"
    "--soft:#222226}}\n"
    "body{margin:0 auto;padding:2.5rem 1.25rem 4rem;max-width:76rem;background:var(--ground);color:var(--ink);"
    "font:16px/1.55 system-ui,-apple-system,\"Segoe UI\",\"Liberation Sans\",Helvetica,Arial,sans-serif}\n"
    "h1{margin:0;font-size:1.75rem;font-weight:600;letter-spacing:-.01em}\n"
    "h2{margin:2.5rem 0 .5rem;font-size:1.2rem;font-weight:600}\n"
    "p{margin:.6rem 0;max-width:46rem}\n"
    ".subtitle{margin:.2rem 0 1.5rem;color:var(--quiet)}\n"
    ".table{overflow-x:auto}\n"
    "table{border-collapse:collapse;margin:.8rem 0;font-size:.92rem;font-variant-numeric:tabular-nums}\n"
    "th,td{padding:.3rem .9rem .3rem 0;text-align:left;border-bottom:1px solid var(--line);white-space:nowrap}\n"
    "th{font-weight:600;color:var(--quiet)}\n"
    "td.t:last-child:not(:first-child){white-space:normal;min-width:18rem}\n"
    ".n{text-align:right;padding:.3rem .9rem .3rem .6rem}\n"
    "tbody tr:hover{background:var(--soft)}\n"
    ".pictures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(20rem,100%),1fr));gap:1.25rem;"
    "margin:1rem 0;align-items:start}\n"
    "figure{margin:0}\n"
    "figure img,figure svg{display:block;width:100%;height:auto;border-radius:4px}\n"
    "figcaption{margin-top:.4rem;font-size:.86rem;line-height:1.4;color:var(--quiet)}\n"
    "@media print{body{max-width:none}figure,tr{break-inside:avoid}}\n";

void alb_page_begin(alb_page *page, const char *title, const char *subtitle)
{
    *page = (alb_page){0};
    alb_text *html = &page->html;
    alb_text_add(html, "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
                       "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>");
    alb_markup_add(html, title);
    alb_text_add(html, "</title>\n<style>\n%s</style>\n</head>\n<body>\n<h1>", style);
    alb_markup_add(html, title);
    alb_text_add(html, "</h1>\n");
    if (subtitle) {
        alb_text_add(html, "<p class=\"subtitle\">");
        alb_markup_add(html, subtitle);
        alb_text_add(html, "</p>\n");
    }
}

static void element(alb_text *html, const char *name, const char *plain)
{
    alb_text_add(html, "<%s>", name);
    alb_markup_add(html, plain);
    alb_text_add(html, "</%s>\n", name);
}

void alb_page_heading(alb_page *page, const char *text) { element(&page->html, "h2", text); }

// The formatted text, owned by the caller; NULL, with the page marked as failed, when memory is short.
static char *formatted(alb_page *page, const char *format, va_list arguments)
{
    char *text = NULL;
    if (vasprintf(&text, format, arguments) < 0) {
        page->html.failed = true;
        return NULL;
    }
    return text;
}

void alb_page_paragraph(alb_page *page, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    char *text = formatted(page, format, arguments);
    va_end(arguments);
    element(&page->html, "p", text);
    free(text);
}

void alb_page_lines(alb_page *page, const char *text)
{
    while (*text) {
        const int length = (int)strcspn(text, "\n");
        alb_page_paragraph(page, "%.*s", length, text);
        text += length + (text[length] == '\n');
    }
}

// A number, perhaps followed by other numbers, units of percent or an uncertainty: "3.1", "-2 %", "1.0 ± 0.1", "1e-3".
static bool is_numeric(const char *cell)
{
    char *end;
    strtod(cell, &end);
    if (end == cell)
        return strncmp(cell, "\u2212", 3) == 0 && isdigit((unsigned char)cell[3]);
    for (; *end; end += strncmp(end, "\u00b1", 2) == 0 ? 2 : 1)
        if (!strchr("0123456789.eE+-% ", *end) && strncmp(end, "\u00b1", 2) != 0)
            return false;
    return true;
}

// Cells of a line separated by '|'. Header cells start as text ('t') and are turned to 'n' by the first row.
static void add_cells(alb_text *html, const char *line, bool header)
{
    char *cells = strdup(line);
    if (!cells) {
        html->failed = true;
        return;
    }
    alb_text_add(html, "<tr>");
    for (char *cell = cells, *next; cell; cell = next) {
        next = strchr(cell, '|');
        if (next)
            *next++ = '\0';
        alb_text_add(html, header ? "<th class=\"t\">" : is_numeric(cell) ? "<td class=\"n\">" : "<td class=\"t\">");
        alb_markup_add(html, cell);
        alb_text_add(html, header ? "</th>" : "</td>");
    }
    alb_text_add(html, "</tr>\n");
    free(cells);
}

void alb_page_table(alb_page *page, const char *header)
{
    alb_text_add(&page->html, "<div class=\"table\"><table>\n<thead>");
    add_cells(&page->html, header, true);
    alb_text_add(&page->html, "</thead>\n<tbody>\n");
}

void alb_page_row(alb_page *page, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    char *line = formatted(page, format, arguments);
    va_end(arguments);
    if (line)
        add_cells(&page->html, line, false);
    free(line);
}

// Aligns each header cell like the first row's cell below it. Escaped texts hold no '<', so that tags are found safely.
static void align_header(char *html)
{
    char *header = NULL;
    for (char *found = html; (found = strstr(found, "<thead>")); found++)
        header = found;
    char *cell = header ? strstr(header, "<td class=\"") : NULL;
    for (; header && cell; cell = strstr(cell + 1, "<td class=\"")) {
        header = strstr(header + 1, "<th class=\"");
        if (header)
            header[strlen("<th class=\"")] = cell[strlen("<td class=\"")];
    }
}

void alb_page_end_table(alb_page *page)
{
    if (page->html.bytes && !page->html.failed)
        align_header(page->html.bytes);
    alb_text_add(&page->html, "</tbody>\n</table></div>\n");
}

void alb_page_begin_pictures(alb_page *page) { alb_text_add(&page->html, "<div class=\"pictures\">\n"); }

static void add_base64(alb_text *html, const unsigned char *bytes, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        const size_t left = size - i;
        const unsigned group =
            (unsigned)(bytes[i] << 16 | (left > 1 ? bytes[i + 1] << 8 : 0) | (left > 2 ? bytes[i + 2] : 0));
        const char quad[4] = {digits[group >> 18], digits[group >> 12 & 63], left > 1 ? digits[group >> 6 & 63] : '=',
                              left > 2 ? digits[group & 63] : '='};
        alb_text_add_bytes(html, quad, sizeof quad);
    }
}

static void end_figure(alb_text *html, const char *caption)
{
    if (caption)
        element(html, "figcaption", caption);
    alb_text_add(html, "</figure>\n");
}

bool alb_page_picture(alb_page *page, const char *path, const char *caption, alb_error *error)
{
    const char *dot = strrchr(alb_path_name(path), '.');
    const bool svg = dot && strcmp(dot, ".svg") == 0;
    char *bytes = NULL;
    size_t size = 0;
    if (!svg && !(dot && strcmp(dot, ".png") == 0))
        return alb_fail(error, ALB_BAD_DATA, "%s: a page shows .png and .svg pictures only", path);
    if (!alb_file_read(&bytes, &size, path, error))
        return false;
    alb_text_add(&page->html, "<figure><img alt=\"");
    alb_markup_add(&page->html, caption);
    alb_text_add(&page->html, "\" src=\"data:image/%s;base64,", svg ? "svg+xml" : "png");
    add_base64(&page->html, (const unsigned char *)bytes, size);
    alb_text_add(&page->html, "\">\n");
    end_figure(&page->html, caption);
    free(bytes);
    return true;
}

void alb_page_svg(alb_page *page, const char *svg, const char *caption)
{
    alb_text_add(&page->html, "<figure>");
    alb_text_add_bytes(&page->html, svg, strlen(svg));
    end_figure(&page->html, caption);
}

void alb_page_end_pictures(alb_page *page) { alb_text_add(&page->html, "</div>\n"); }

bool alb_page_write(alb_page *page, const char *path, alb_error *error)
{
    alb_text_add(&page->html, "</body>\n</html>\n");
    const bool written = alb_file_write_text(path, &page->html, error);
    alb_page_free(page);
    return written;
}

void alb_page_free(alb_page *page)
{
    alb_text_free(&page->html);
    *page = (alb_page){0};
}
