// Reads a plan strictly and refuses what cannot be photographed: every message names the file, line and key.
#include "capture/plan.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

const char *const alb_side_names[ALB_SIDES] = {"reflection", "transmission"};
const char *const alb_finish_names[ALB_FINISHS] = {"smooth", "ground"};
const char *const alb_target_names[ALB_TARGETS] = {"slab", "white_reference", "diffuser", "board", "cap"};
const char *const alb_pattern_names[ALB_PATTERNS] = {"black", "white", "spot", "grid", "chessboard"};

// Which patterns make sense on which target; a bit per pattern.
#define BIT(pattern) (1u << ALB_PATTERN_##pattern)
static const unsigned patterns_on[ALB_TARGETS] = {
    [ALB_TARGET_SLAB] = BIT(BLACK) | BIT(WHITE) | BIT(SPOT) | BIT(GRID),
    [ALB_TARGET_WHITE] = BIT(BLACK) | BIT(WHITE) | BIT(SPOT) | BIT(GRID),
    [ALB_TARGET_DIFFUSER] = BIT(WHITE),
    [ALB_TARGET_BOARD] = BIT(CHESSBOARD),
    [ALB_TARGET_CAP] = BIT(BLACK),
};

bool alb_pattern_same(const alb_pattern *a, const alb_pattern *b)
{
    return a->kind == b->kind && a->diameter_px == b->diameter_px && a->columns == b->columns && a->rows == b->rows &&
           a->pitch_px == b->pitch_px;
}

bool alb_disc_lights(double diameter_px, int x, int y)
{
    const int across = (int)ceil(diameter_px);
    const double dx = x - 0.5 * (across - 1), dy = y - 0.5 * (across - 1);
    return across == 1 || dx * dx + dy * dy <= 0.25 * diameter_px * diameter_px;
}

// Names become file names.
static bool name(char out[ALB_NAME_SIZE], alb_node object, const char *key, alb_error *error)
{
    const char *text;
    if (!alb_node_text(&text, object, key, error))
        return false;
    const size_t length = strlen(text);
    if (!length || length >= ALB_NAME_SIZE || strspn(text, "abcdefghijklmnopqrstuvwxyz0123456789_") != length)
        return alb_node_fail(error, object, key, "found \"%.60s\", expected 1 to %d characters of a-z, 0-9 and _", text,
                             ALB_NAME_SIZE - 1);
    memcpy(out, text, length + 1);
    return true;
}

static bool count(int *out, alb_node object, const char *key, long minimum, long maximum, alb_error *error)
{
    long value;
    if (!alb_node_integer(&value, object, key, minimum, maximum, error))
        return false;
    *out = (int)value;
    return true;
}

static bool parse_pattern(alb_pattern *pattern, alb_node shot, alb_error *error)
{
    alb_node node;
    int kind = 0;
    if (!alb_node_object(&node, shot, "pattern", error) ||
        !alb_node_choice(&kind, node, "kind", alb_pattern_names, ALB_PATTERNS, error))
        return false;
    pattern->kind = (alb_pattern_kind)kind;
    const bool grid = kind == ALB_PATTERN_GRID, disc = grid || kind == ALB_PATTERN_SPOT;
    if (!alb_node_allow(node,
                        grid   ? "kind diameter_px columns rows pitch_px"
                        : disc ? "kind diameter_px"
                               : "kind",
                        error))
        return false;
    if (disc && !alb_node_number(&pattern->diameter_px, node, "diameter_px", 1, 1000, error))
        return false;
    if (!grid)
        return true;
    if (!count(&pattern->columns, node, "columns", 1, 100, error) ||
        !count(&pattern->rows, node, "rows", 1, 100, error) ||
        !alb_node_number(&pattern->pitch_px, node, "pitch_px", 1, 4000, error))
        return false;
    if (pattern->pitch_px < pattern->diameter_px)
        return alb_node_fail(error, node, "pitch_px", "found %g, less than the diameter of %g: the discs overlap",
                             pattern->pitch_px, pattern->diameter_px);
    return true;
}

static bool parse_exposures(alb_shot *shot, alb_node object, alb_error *error)
{
    alb_node list;
    size_t size;
    if (!alb_node_list(&list, &size, object, "exposures_s", error))
        return false;
    if (size < 1 || size > ALB_EXPOSURES_MAX)
        return alb_node_fail(error, object, "exposures_s", "found %zu exposures, expected 1 to %d", size,
                             ALB_EXPOSURES_MAX);
    for (size_t i = 0; i < size; i++) {
        if (!alb_node_item_number(&shot->exposures_s[i], list, i, 1e-6, 3600, error))
            return false;
        if (i && !(shot->exposures_s[i] > shot->exposures_s[i - 1]))
            return alb_node_fail(error, object, "exposures_s", "%g s follows %g s: exposures must ascend",
                                 shot->exposures_s[i], shot->exposures_s[i - 1]);
        shot->obtained_s[i] = shot->exposures_s[i];
    }
    shot->exposure_count = (int)size;
    return true;
}

static bool parse_shot(alb_shot *shot, alb_node object, alb_error *error)
{
    int side = ALB_REFLECTION, target = 0;
    *shot = (alb_shot){.repeats = 1};
    if (!name(shot->name, object, "name", error) ||
        (alb_node_has(object, "side") && !alb_node_choice(&side, object, "side", alb_side_names, ALB_SIDES, error)) ||
        !alb_node_choice(&target, object, "target", alb_target_names, ALB_TARGETS, error) ||
        !parse_pattern(&shot->pattern, object, error) || !parse_exposures(shot, object, error) ||
        (alb_node_has(object, "repeats") && !count(&shot->repeats, object, "repeats", 1, 100, error)) ||
        (alb_node_has(object, "in_hand") && !alb_node_boolean(&shot->in_hand, object, "in_hand", error)))
        return false;
    shot->side = (alb_side)side;
    shot->target = (alb_target)target;
    if (!(patterns_on[target] & 1u << shot->pattern.kind))
        return alb_node_fail(error, object, "pattern", "a %s pattern on the %s cannot be photographed",
                             alb_pattern_names[shot->pattern.kind], alb_target_names[target]);
    if (shot->in_hand && target != ALB_TARGET_BOARD)
        return alb_node_fail(error, object, "in_hand", "only a board is held in the hand; this is the %s",
                             alb_target_names[target]);
    if (target == ALB_TARGET_WHITE && side != ALB_REFLECTION)
        return alb_node_fail(error, object, "side", "the white reference is opaque: it shows light in reflection only");
    return true;
}

static bool parse_shots(alb_plan *plan, alb_node object, alb_error *error)
{
    alb_node list;
    size_t size;
    if (!alb_node_list(&list, &size, object, "shots", error))
        return false;
    if (size < 1 || size > ALB_SHOTS_MAX)
        return alb_node_fail(error, object, "shots", "found %zu shots, expected 1 to %d", size, ALB_SHOTS_MAX);
    for (size_t i = 0; i < size; i++) {
        alb_node item;
        alb_shot *shot = &plan->shots[i];
        if (!alb_node_item_object(&item, list, i, error) ||
            !alb_node_allow(item, "name side target pattern exposures_s repeats in_hand", error) ||
            !parse_shot(shot, item, error))
            return false;
        for (size_t j = 0; j < i; j++)
            if (!strcmp(shot->name, plan->shots[j].name))
                return alb_node_fail(error, item, "name", "\"%s\" is the name of shot %zu too; names must differ",
                                     shot->name, j + 1);
    }
    plan->shot_count = (int)size;
    return true;
}

bool alb_finish_read(alb_finish *finish, alb_node object, alb_error *error)
{
    int choice = ALB_FINISH_SMOOTH;
    const bool ok = !alb_node_has(object, "finish") ||
                    alb_node_choice(&choice, object, "finish", alb_finish_names, ALB_FINISHS, error);
    *finish = (alb_finish)choice;
    return ok;
}

bool alb_plan_parse(alb_plan *plan, alb_node object, alb_error *error)
{
    alb_node sample, white, board;
    *plan = (alb_plan){0};
    return alb_node_object(&sample, object, "sample", error) &&
           alb_node_allow(sample, "name thickness_mm refractive_index finish", error) &&
           name(plan->sample, sample, "name", error) &&
           alb_node_number(&plan->thickness_mm, sample, "thickness_mm", 0.01, 1000, error) &&
           alb_node_number(&plan->refractive_index, sample, "refractive_index", 1, 4, error) &&
           alb_finish_read(&plan->finish, sample, error) && alb_node_object(&white, object, "white_reference", error) &&
           alb_node_allow(white, "reflectance", error) &&
           alb_node_numbers(plan->white_reflectance, 3, white, "reflectance", 0.01, 1, error) &&
           alb_node_object(&board, object, "board", error) && alb_node_allow(board, "columns rows square_mm", error) &&
           count(&plan->board_columns, board, "columns", 3, 60, error) &&
           count(&plan->board_rows, board, "rows", 3, 60, error) &&
           alb_node_number(&plan->board_square_mm, board, "square_mm", 0.05, 500, error) &&
           parse_shots(plan, object, error);
}

bool alb_plan_read(alb_plan *plan, const char *path, alb_error *error)
{
    alb_node root;
    alb_record *record = alb_record_read(path, error);
    const bool ok = record && alb_record_root(&root, record, error) &&
                    alb_node_allow(root, "format sample white_reference board shots", error) &&
                    alb_plan_parse(plan, root, error);
    alb_record_free(record);
    return ok;
}

static void put_shot(alb_json *json, const alb_shot *shot)
{
    const alb_pattern *pattern = &shot->pattern;
    alb_json_string(json, "name", shot->name);
    alb_json_string(json, "side", alb_side_names[shot->side]);
    alb_json_string(json, "target", alb_target_names[shot->target]);
    alb_json_object(json, "pattern");
    alb_json_string(json, "kind", alb_pattern_names[pattern->kind]);
    if (pattern->kind == ALB_PATTERN_SPOT || pattern->kind == ALB_PATTERN_GRID)
        alb_json_number(json, "diameter_px", pattern->diameter_px);
    if (pattern->kind == ALB_PATTERN_GRID) {
        alb_json_integer(json, "columns", pattern->columns);
        alb_json_integer(json, "rows", pattern->rows);
        alb_json_number(json, "pitch_px", pattern->pitch_px);
    }
    alb_json_end_object(json);
    alb_json_numbers(json, "exposures_s", shot->exposures_s, (size_t)shot->exposure_count);
    alb_json_integer(json, "repeats", shot->repeats);
    alb_json_boolean(json, "in_hand", shot->in_hand);
}

void alb_plan_put(alb_json *json, const alb_plan *plan)
{
    alb_json_object(json, "sample");
    alb_json_string(json, "name", plan->sample);
    alb_json_number(json, "thickness_mm", plan->thickness_mm);
    alb_json_number(json, "refractive_index", plan->refractive_index);
    alb_json_string(json, "finish", alb_finish_names[plan->finish]);
    alb_json_end_object(json);
    alb_json_object(json, "white_reference");
    alb_json_numbers(json, "reflectance", plan->white_reflectance, 3);
    alb_json_end_object(json);
    alb_json_object(json, "board");
    alb_json_integer(json, "columns", plan->board_columns);
    alb_json_integer(json, "rows", plan->board_rows);
    alb_json_number(json, "square_mm", plan->board_square_mm);
    alb_json_end_object(json);
    alb_json_list(json, "shots");
    for (int i = 0; i < plan->shot_count; i++) {
        alb_json_object(json, NULL);
        put_shot(json, &plan->shots[i]);
        alb_json_end_object(json);
    }
    alb_json_end_list(json);
}
