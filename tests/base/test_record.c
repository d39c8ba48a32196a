// Records: strictness, positions of errors, and the JSON test suite (nst/JSONTestSuite) where the shared data stand.
#include "base/json.h"
#include "base/record.h"
#include "check.h"
#include <dirent.h>
#include <float.h>

static alb_record *parse(const char *text, alb_error *error)
{
    return alb_record_parse("a.json", text, strlen(text), error);
}

static void errors_name_line_and_column(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_record *record = parse("{\"format\": 1,\n  \"list\": [1, {\"b\": \"x\\\"]\"}, -7],\n  \"c\": 0.5}", &error);
    assert_non_null(record);
    alb_node root, list, item;
    size_t count;
    double number;
    long integer;
    check_ok(alb_record_root(&root, record, &error), &error);
    check_ok(alb_node_list(&list, &count, root, "list", &error), &error);
    assert_int_equal(count, 3);
    check_ok(alb_node_item_object(&item, list, 1, &error), &error);
    check_fails(alb_node_number(&number, item, "b", 0, 1, &error), &error, ALB_BAD_DATA,
                "a.json:2:16: list[1].b: expected a number, found text");
    check_fails(alb_node_item_number(&number, list, 2, 0, 1, &error), &error, ALB_BAD_DATA,
                "a.json:2:30: list[2]: found -7");
    check_fails(alb_node_integer(&integer, root, "c", 0, 1, &error), &error, ALB_BAD_DATA,
                "a.json:3:3: c: expected a whole");
    check_fails(alb_node_number(&number, root, "d", 0, 1, &error), &error, ALB_BAD_DATA, "\"d\" is missing");
    check_fails(alb_node_allow(root, "format list", &error), &error, ALB_BAD_DATA, "a.json:3:3: c: unknown key");
    check_ok(alb_node_allow(root, "format list c", &error), &error);
    check_fails(alb_node_item_number(&number, alb_node_item(list, 0), 0, 0, 1, &error), &error, ALB_BAD_DATA,
                "expected");
    alb_record_free(record);
}

static void format_is_required(void **state)
{
    (void)state;
    const char *const wrong[] = {"{}", "[]", "{\"format\": 2}", "{\"format\": \"1\"}"};
    for (int i = 0; i < 4; i++) {
        alb_error error = {0};
        alb_node root;
        alb_record *record = parse(wrong[i], &error);
        assert_non_null(record);
        check_fails(alb_record_root(&root, record, &error), &error, ALB_BAD_DATA, "a.json:1:");
        alb_record_free(record);
    }
}

static void choices_are_among_their_names(void **state)
{
    (void)state;
    static const char *const names[] = {"slab", "solid"};
    alb_error error = {0};
    alb_record *record = parse("{\"format\": 1, \"a\": \"solid\", \"b\": \"sol\", \"c\": 1}", &error);
    assert_non_null(record);
    alb_node root;
    int chosen = -1;
    check_ok(alb_record_root(&root, record, &error), &error);
    check_ok(alb_node_choice(&chosen, root, "a", names, 2, &error), &error);
    assert_int_equal(chosen, 1);
    check_fails(alb_node_choice(&chosen, root, "b", names, 2, &error), &error, ALB_BAD_DATA,
                "a.json:1:29: b: found \"sol\", expected one of slab, solid");
    check_fails(alb_node_choice(&chosen, root, "c", names, 2, &error), &error, ALB_BAD_DATA, "expected text");
    assert_int_equal(chosen, 1); // as it was
    alb_record_free(record);
}

static void doubles_survive_the_round_trip(void **state)
{
    (void)state;
    const double values[] = {0.1, 1.0 / 3, 5e-324, 1.7976931348623157e308, -2.5, 1e21, 123456789012345.67};
    alb_error error = {0};
    alb_json json;
    alb_json_begin(&json, NULL);
    alb_json_numbers(&json, "v", values, 7);
    alb_json_string(&json, "s", "quote \" back \\ line\nend");
    alb_json_estimate(&json, "e", 1, 0.5);
    check_ok(alb_json_write(&json, "round.json", &error), &error);
    alb_record *record = alb_record_read("round.json", &error);
    assert_non_null(record);
    alb_node root;
    double back[7];
    const char *text;
    check_ok(alb_record_root(&root, record, &error), &error);
    check_ok(alb_node_numbers(back, 7, root, "v", -DBL_MAX, DBL_MAX, &error), &error);
    assert_memory_equal(values, back, sizeof values);
    check_ok(alb_node_text(&text, root, "s", &error), &error);
    assert_string_equal(text, "quote \" back \\ line\nend");
    alb_record_free(record);
}

static void json_suite(void **state)
{
    (void)state;
    const char *folder = ALB_SHARED_DATA "/bad_input/json";
    DIR *entries = opendir(folder);
    if (!entries) {
        print_message("skipped: %s is not here\n", folder);
        skip();
    }
    int accepted = 0, rejected = 0;
    for (struct dirent *entry; (entry = readdir(entries));) {
        char path[4096];
        alb_error error = {0};
        if (entry->d_name[0] == '.')
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        alb_record *record = alb_record_read(path, &error);
        // A key given twice is ambiguous and a key with a NUL cannot be a C string: records refuse what JSON allows.
        const bool refused = strstr(entry->d_name, "duplicated_key") || strstr(entry->d_name, "null_in_key");
        if ((entry->d_name[0] == 'y' && !record && !refused) || (entry->d_name[0] == 'n' && record)) {
            print_error("%s: %s\n", entry->d_name, record ? "accepted" : error.text);
            fail();
        }
        accepted += record != NULL;
        rejected += record == NULL;
        alb_record_free(record);
    }
    closedir(entries);
    assert_true(accepted > 60 && rejected > 120);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_name_line_and_column),
        cmocka_unit_test(format_is_required),
        cmocka_unit_test(choices_are_among_their_names),
        cmocka_unit_test(doubles_survive_the_round_trip),
        cmocka_unit_test(json_suite),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
