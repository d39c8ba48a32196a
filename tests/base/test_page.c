#include "base/file.h"
#include "base/markup.h"
#include "base/page.h"
#include "check.h"
#include "well_formed.h"

static char *written(alb_page *page)
{
    alb_error error = {0};
    char *bytes = NULL;
    size_t size = 0;
    check_ok(alb_page_write(page, "test_page.html", &error), &error);
    assert_null(page->html.bytes);
    check_ok(alb_file_read(&bytes, &size, "test_page.html", &error), &error);
    assert_true(well_formed(bytes));
    remove("test_page.html");
    return bytes;
}

static void page_is_well_formed_and_escaped(void **state)
{
    (void)state;
    alb_page page;
    alb_page_begin(&page, "a < b & c", "sub \"title\"");
    alb_page_heading(&page, "<h1>");
    alb_page_paragraph(&page, "%s %d %% \xc3", "<script>alert(1)</script>", 7);
    char *html = written(&page);
    assert_null(strstr(html, "<script"));
    assert_non_null(strstr(html, "<title>a &lt; b &amp; c</title>"));
    assert_non_null(strstr(html, "&lt;script&gt;alert(1)&lt;/script&gt; 7 % \xef\xbf\xbd"));
    assert_null(strstr(html, "http")); // nothing is fetched
    free(html);
}

static void numbers_align_right_with_their_header(void **state)
{
    (void)state;
    alb_page page;
    alb_page_begin(&page, "t", NULL);
    alb_page_table(&page, "side|total|form");
    alb_page_row(&page, "reflection|%+.2f %%|two|", -1.5);
    alb_page_row(&page, "<td class=\"|%s|x", "1.0 \u00b1 0.1");
    alb_page_end_table(&page);
    alb_page_table(&page, "a|b");
    alb_page_end_table(&page);
    char *html = written(&page);
    assert_non_null(strstr(html, "<th class=\"t\">side</th><th class=\"n\">total</th><th class=\"t\">form</th>"));
    assert_non_null(strstr(html, "<td class=\"n\">-1.50 %</td>"));
    assert_non_null(strstr(html, "<td class=\"n\">1.0 \u00b1 0.1</td>"));
    assert_non_null(strstr(html, "<th class=\"t\">a</th><th class=\"t\">b</th>"));
    free(html);
}

static void pictures_are_embedded(void **state)
{
    (void)state;
    alb_error error = {0};
    const struct {
        const char *bytes, *base64;
    } cases[] = {
        {"", ""}, {"f", "Zg=="}, {"fo", "Zm8="}, {"foo", "Zm9v"}, {"foobar", "Zm9vYmFy"}}; // RFC 4648, section 10
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char expected[64];
        alb_page page;
        check_ok(alb_file_write("test_page.png", cases[i].bytes, strlen(cases[i].bytes), &error), &error);
        alb_page_begin(&page, "t", NULL);
        alb_page_begin_pictures(&page);
        check_ok(alb_page_picture(&page, "test_page.png", "\"quoted\" > caption", &error), &error);
        alb_page_svg(&page, "<svg></svg>", NULL);
        alb_page_end_pictures(&page);
        char *html = written(&page);
        snprintf(expected, sizeof expected, "src=\"data:image/png;base64,%s\">", cases[i].base64);
        assert_non_null(strstr(html, expected));
        free(html);
    }
    remove("test_page.png");
}

static void bad_pictures_and_places_fail(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_page page;
    alb_page_begin(&page, "t", NULL);
    check_fails(alb_page_picture(&page, "missing.png", NULL, &error), &error, ALB_ACCESS, "missing.png");
    check_fails(alb_page_picture(&page, "picture.exr", NULL, &error), &error, ALB_BAD_DATA, "picture.exr");
    check_fails(alb_page_write(&page, "/nowhere/at/all.html", &error), &error, ALB_ACCESS, "all.html");
    alb_page_free(&page);
}

static void utf8_is_checked(void **state)
{
    (void)state;
    const char *const valid[] = {"\u00b5", "\u2212", "\U0001f600", "plain"};
    const char *const broken[] = {"\xc0\xaf", "\xed\xa0\x80", "\xf5\x80\x80\x80", "\x80",
                                  "\xe2\x88", "\x1b",         "\xf0\x80\x80\x80"};
    for (size_t i = 0; i < sizeof valid / sizeof *valid; i++) {
        alb_text text = {0};
        alb_markup_add(&text, valid[i]);
        assert_string_equal(text.bytes, valid[i]);
        alb_text_free(&text);
    }
    for (size_t i = 0; i < sizeof broken / sizeof *broken; i++) {
        alb_text text = {0};
        alb_markup_add(&text, broken[i]);
        assert_int_equal(text.size, 3 * strlen(broken[i])); // every byte became U+FFFD
        alb_text_free(&text);
    }
    assert_int_equal(alb_markup_length("1/mm\u00b2"), 5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(page_is_well_formed_and_escaped),
        cmocka_unit_test(numbers_align_right_with_their_header),
        cmocka_unit_test(pictures_are_embedded),
        cmocka_unit_test(bad_pictures_and_places_fail),
        cmocka_unit_test(utf8_is_checked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
