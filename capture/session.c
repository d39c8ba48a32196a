// session.json: what was photographed, with what, and the frames with their hashes. The plan stands in it in full, so
// that a session needs no other file than its frames.
#include "capture/plan.h"
#include <stdio.h>
#include <string.h>

bool alb_session_frame(char path[ALB_PATH_SIZE], const alb_session *session, const alb_shot *shot, int exposure,
                       int repeat, alb_error *error)
{
    char file[ALB_NAME_SIZE + 64];
    snprintf(file, sizeof file, "frames/%s_e%d_r%d.exr", shot->name, exposure, repeat);
    return alb_path_join(path, session->folder, file, error);
}

static bool put_frames(alb_json *json, const alb_session *session, const alb_shot *shot, alb_error *error)
{
    alb_json_object(json, NULL);
    alb_json_string(json, "shot", shot->name);
    alb_json_numbers(json, "asked_s", shot->exposures_s, (size_t)shot->exposure_count);
    alb_json_numbers(json, "obtained_s", shot->obtained_s, (size_t)shot->exposure_count);
    alb_json_list(json, "files");
    for (int repeat = 0; repeat < shot->repeats; repeat++)
        for (int exposure = 0; exposure < shot->exposure_count; exposure++) {
            char path[ALB_PATH_SIZE], hash[ALB_HASH_SIZE];
            if (!alb_session_frame(path, session, shot, exposure, repeat, error) || !alb_hash_file(hash, path, error))
                return false;
            alb_json_object(json, NULL);
            alb_json_string(json, "name", alb_path_name(path));
            alb_json_string(json, "sha256", hash);
            alb_json_end_object(json);
        }
    alb_json_end_list(json);
    alb_json_end_object(json);
    return true;
}

bool alb_session_write(const alb_session *session, const alb_provenance *provenance, alb_error *error)
{
    alb_json json;
    char path[ALB_PATH_SIZE];
    alb_json_begin(&json, provenance);
    alb_json_string(&json, "rig", session->rig);
    alb_json_object(&json, "camera");
    alb_json_integer(&json, "width", session->width);
    alb_json_integer(&json, "height", session->height);
    alb_json_list(&json, "channels");
    for (int c = 0; c < session->channels; c++)
        alb_json_string(&json, NULL, session->channel_names[c]);
    alb_json_end_list(&json);
    alb_json_number(&json, "white_level_dn", session->white_level_dn);
    alb_json_end_object(&json);
    alb_json_object(&json, "plan");
    alb_plan_put(&json, &session->plan);
    alb_json_end_object(&json);
    alb_json_list(&json, "frames");
    for (int i = 0; i < session->plan.shot_count; i++)
        if (!put_frames(&json, session, &session->plan.shots[i], error)) {
            alb_json_free(&json);
            return false;
        }
    alb_json_end_list(&json);
    if (alb_path_join(path, session->folder, "session.json", error))
        return alb_json_write(&json, path, error);
    alb_json_free(&json);
    return false;
}

static bool parse_camera(alb_session *session, alb_node root, alb_error *error)
{
    alb_node camera, list;
    size_t size;
    long width, height;
    if (!alb_node_object(&camera, root, "camera", error) ||
        !alb_node_allow(camera, "width height channels white_level_dn", error) ||
        !alb_node_integer(&width, camera, "width", 1, 65536, error) ||
        !alb_node_integer(&height, camera, "height", 1, 65536, error) ||
        !alb_node_number(&session->white_level_dn, camera, "white_level_dn", 1e-30, 1e30, error) ||
        !alb_node_list(&list, &size, camera, "channels", error))
        return false;
    if (size != 1 && size != 3)
        return alb_node_fail(error, camera, "channels", "found %zu channels, expected 1 or 3", size);
    for (size_t c = 0; c < size; c++) {
        const char *text;
        if (!alb_node_item_text(&text, list, c, error))
            return false;
        if (!text[0] || strlen(text) >= sizeof session->channel_names[c])
            return alb_node_fail(error, camera, "channels", "\"%.20s\" is not the name of a channel", text);
        strcpy(session->channel_names[c], text);
    }
    session->width = (int)width, session->height = (int)height, session->channels = (int)size;
    return true;
}

// The obtained exposures of one shot; that its files are those of the plan and exist.
static bool parse_frames(alb_session *session, alb_shot *shot, alb_node item, alb_error *error)
{
    const char *text, *hash;
    alb_node files, file;
    size_t size;
    const size_t exposures = (size_t)shot->exposure_count, expected = exposures * (size_t)shot->repeats;
    double asked[ALB_EXPOSURES_MAX];
    if (!alb_node_allow(item, "shot asked_s obtained_s files", error) || !alb_node_text(&text, item, "shot", error) ||
        !alb_node_numbers(asked, exposures, item, "asked_s", 1e-6, 3600, error) ||
        !alb_node_numbers(shot->obtained_s, exposures, item, "obtained_s", 1e-9, 1e6, error) ||
        !alb_node_list(&files, &size, item, "files", error))
        return false;
    if (strcmp(text, shot->name))
        return alb_node_fail(error, item, "shot", "found \"%.60s\", expected \"%s\" as in the plan", text, shot->name);
    if (size != expected)
        return alb_node_fail(error, item, "files", "found %zu files, the plan asks for %zu", size, expected);
    for (size_t i = 0; i < size; i++) {
        char path[ALB_PATH_SIZE];
        const int exposure = (int)(i % exposures), repeat = (int)(i / exposures);
        if (!alb_node_item_object(&file, files, i, error) || !alb_node_allow(file, "name sha256", error) ||
            !alb_node_text(&text, file, "name", error) || !alb_node_text(&hash, file, "sha256", error) ||
            !alb_session_frame(path, session, shot, exposure, repeat, error))
            return false;
        if (strcmp(text, alb_path_name(path)))
            return alb_node_fail(error, file, "name", "found \"%.80s\", expected \"%s\"", text, alb_path_name(path));
        if (!alb_file_exists(path))
            return alb_fail(error, ALB_ACCESS, "%s: the frame is missing; capture the session again", path);
    }
    return true;
}

static bool parse(alb_session *session, alb_node root, alb_error *error)
{
    alb_node plan, frames, item;
    const char *rig;
    size_t size;
    if (!alb_node_allow(root, "format provenance rig camera plan frames", error) ||
        !alb_node_text(&rig, root, "rig", error) || !parse_camera(session, root, error) ||
        !alb_node_object(&plan, root, "plan", error) ||
        !alb_node_allow(plan, "sample white_reference board shots", error) ||
        !alb_plan_parse(&session->plan, plan, error) || !alb_node_list(&frames, &size, root, "frames", error))
        return false;
    snprintf(session->rig, sizeof session->rig, "%s", rig);
    if (size != (size_t)session->plan.shot_count)
        return alb_node_fail(error, root, "frames", "found %zu shots, the plan has %d", size, session->plan.shot_count);
    for (size_t i = 0; i < size; i++)
        if (!alb_node_item_object(&item, frames, i, error) ||
            !parse_frames(session, &session->plan.shots[i], item, error))
            return false;
    return true;
}

bool alb_session_read(alb_session *session, const char *folder, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    alb_node root;
    *session = (alb_session){0};
    if (!alb_path_join(path, folder, "session.json", error))
        return false;
    strcpy(session->folder, folder); // shorter than path
    alb_record *record = alb_record_read(path, error);
    const bool ok = record && alb_record_root(&root, record, error) && parse(session, root, error);
    alb_record_free(record);
    return ok;
}
