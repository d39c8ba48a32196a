// JSON records: base/record.c. Reading every kind of value of the top must not fail badly either.
#include "base/record.h"
#include "fuzz.h"

bool fuzz_accepts(const uint8_t *bytes, size_t size, alb_error *error)
{
    alb_record *record = alb_record_parse("fuzz.json", (const char *)bytes, size, error);
    if (!record)
        return false;
    alb_node top, list;
    double number;
    const char *text;
    size_t count;
    if (alb_record_root(&top, record, NULL)) {
        for (size_t i = 0; i < alb_node_key_count(top); i++) {
            const char *key = alb_node_key(top, i);
            fuzz_law(alb_node_has(top, key), "a key that is listed is there");
            alb_node_number(&number, top, key, -1, 1, NULL);
            alb_node_text(&text, top, key, NULL);
            if (alb_node_list(&list, &count, top, key, NULL))
                for (size_t k = 0; k < count; k++)
                    alb_node_item_number(&number, list, k, -1, 1, NULL);
        }
        alb_node_allow(top, "format", NULL);
    }
    alb_record_free(record);
    return true;
}
