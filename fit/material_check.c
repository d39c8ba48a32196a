// Types of the members of material.json that describe a fit and that nobody computes with: a file that was edited by
// hand, or cut and pasted, is noticed here rather than in a page made of it.
#include "fit/material_check.h"
#include <stdio.h>
#include <string.h>

// Whether `key` is one of the words.
static bool listed(const char *words, const char *key)
{
    const size_t length = strlen(key);
    for (const char *at = words; length && (at = strstr(at, key)); at++)
        if ((at == words || at[-1] == ' ') && (at[length] == ' ' || at[length] == '\0'))
            return true;
    return false;
}

static bool check_number(alb_node object, const char *key, alb_error *error)
{
    double value;
    return alb_node_null(object, key) || alb_node_number(&value, object, key, -1e300, 1e300, error);
}

// Every member that is listed has the type of its list; others are not looked at.
static bool check_members(alb_node object, const char *numbers, const char *texts, const char *booleans,
                          alb_error *error)
{
    const char *text;
    bool truth;
    for (size_t i = 0; i < alb_node_key_count(object); i++) {
        const char *key = alb_node_key(object, i);
        if ((listed(numbers, key) && !check_number(object, key, error)) ||
            (listed(texts, key) && !alb_node_text(&text, object, key, error)) ||
            (listed(booleans, key) && !alb_node_boolean(&truth, object, key, error)))
            return false;
    }
    return true;
}

// An object of numbers alone, where it is there.
static bool check_object(alb_node side, const char *key, const char *numbers, alb_error *error)
{
    alb_node object;
    return !alb_node_has(side, key) ||
           (alb_node_object(&object, side, key, error) && alb_node_allow(object, numbers, error) &&
            check_members(object, numbers, "", "", error));
}

bool alb_estimate_check(alb_node object, const char *key, alb_error *error)
{
    alb_node estimate, interval;
    size_t count;
    double value;
    if (!alb_node_object(&estimate, object, key, error) ||
        !alb_node_allow(estimate, "value sd interval_95 cramer_rao_sd identifiable because", error) ||
        !check_members(estimate, "value sd cramer_rao_sd", "because", "identifiable", error))
        return false;
    if (!alb_node_has(estimate, "interval_95"))
        return true;
    if (!alb_node_list(&interval, &count, estimate, "interval_95", error))
        return false;
    if (count != 2)
        return alb_node_fail(error, estimate, "interval_95", "%zu ends; 2 are wanted", count);
    for (size_t i = 0; i < count; i++)
        if (!alb_node_item_null(interval, i) && !alb_node_item_number(&value, interval, i, -1e300, 1e300, error))
            return false;
    return true;
}

static bool check_tried(alb_node side, alb_error *error)
{
    static const char numbers[] = "decay_ratio_held chi_square degrees_of_freedom p_value bic bic_excess "
                                  "residual_lag_1 residual_lag_1_p_value",
                      texts[] = "form at_bound rejected";
    char all[sizeof numbers + sizeof texts];
    alb_node tried, one;
    size_t count;
    if (!alb_node_has(side, "tried"))
        return true;
    snprintf(all, sizeof all, "%s %s", numbers, texts);
    if (!alb_node_list(&tried, &count, side, "tried", error))
        return false;
    for (size_t i = 0; i < count; i++)
        if (!alb_node_item_object(&one, tried, i, error) || !alb_node_allow(one, all, error) ||
            !check_members(one, numbers, texts, "", error))
            return false;
    return true;
}

bool alb_outcome_check(alb_node side, alb_error *error)
{
    return check_members(side,
                         "decay_ratio_held condition total_without_inner_fifth total_without_outer_fifth "
                         "discrepancy_relative rms_relative left_out_to_mm measured_share_of_total",
                         "undecided offset_instead errors_from", "best_guess", error) &&
           check_object(side, "offset_per_mm2", "value sd", error) &&
           check_object(side, "energy_held", "free_total chi_square_rise", error) &&
           check_object(side, "ballistic_share", "value sd", error) &&
           check_object(side, "tail_slope_per_mm", "value sd from_mm to_mm", error) && check_tried(side, error);
}
