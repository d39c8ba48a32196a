// The folder rig: replays frames from files named as a session's, <shot>_e<exposure>_r<repeat>, with any of the endings
// below. DIR/camera.json says what the files cannot:
//   {"format": 1, "white_level_dn": 4095, "response": "linear" | "srgb" | {"gamma": 2.2} | {"table": [256 numbers]},
//    "obtained_s": {"SHOT": [one per exposure], ...}}
// Without it 16-bit files are linear with the white level 65535, and others are refused. 8-bit values v become linear
// DN:
//   gamma 255 (v/255)^G,  sRGB (IEC 61966-2-1) 255 (v/255)/12.92 or 255 ((v/255 + 0.055)/1.055)^2.4,  table[v],
// and a white level stands for linear DN. Noise of such frames is no longer that of counted photons.
#include "base/memory.h"
#include "base/record.h"
#include "capture/rig.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const endings[] = {"exr", "png", "tif", "tiff", "jpg"};

typedef struct folder_rig {
    char folder[ALB_PATH_SIZE];
    bool has_response; // 8-bit files may be used
    bool is_linear;
    double table[256];
    bool has_white_level;
} folder_rig;

static bool find(char path[ALB_PATH_SIZE], const folder_rig *rig, const char *shot, int exposure, int repeat,
                 alb_error *error)
{
    for (size_t i = 0; i < sizeof endings / sizeof *endings; i++) {
        char name[ALB_NAME_SIZE + 64];
        snprintf(name, sizeof name, "%s_e%d_r%d.%s", shot, exposure, repeat, endings[i]);
        if (!alb_path_join(path, rig->folder, name, error))
            return false;
        if (alb_file_exists(path))
            return true;
    }
    return alb_fail(error, ALB_ACCESS, "%s/%s_e%d_r%d: no such frame (.exr, .png, .tif, .tiff or .jpg)", rig->folder,
                    shot, exposure, repeat);
}

static double srgb_linear(double v) { return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4); }

static bool parse_response(folder_rig *rig, alb_node root, alb_error *error)
{
    alb_node node;
    const char *text = "";
    alb_error not_object = {0};
    rig->has_response = true;
    if (alb_node_object(&node, root, "response", &not_object)) {
        double gamma;
        const bool table = alb_node_has(node, "table");
        if (!alb_node_allow(node, table ? "table" : "gamma", error))
            return false;
        if (!table && !alb_node_number(&gamma, node, "gamma", 0.1, 10, error))
            return false;
        if (table && !alb_node_numbers(rig->table, 256, node, "table", 0, 1e9, error))
            return false;
        for (int v = 0; v < 256 && !table; v++)
            rig->table[v] = 255 * pow(v / 255.0, gamma);
        for (int v = 1; v < 256; v++)
            if (rig->table[v] < rig->table[v - 1])
                return alb_node_fail(error, node, "table", "entry %d is less than the one before; a response rises", v);
        return true;
    }
    if (!alb_node_text(&text, root, "response", error))
        return false;
    rig->is_linear = !strcmp(text, "linear");
    if (!rig->is_linear && strcmp(text, "srgb"))
        return alb_node_fail(error, root, "response",
                             "found \"%.40s\", expected \"linear\", \"srgb\", {\"gamma\": G} or "
                             "{\"table\": [256 numbers]}",
                             text);
    for (int v = 0; v < 256; v++)
        rig->table[v] = rig->is_linear ? v : 255 * srgb_linear(v / 255.0);
    return true;
}

static bool parse_camera(folder_rig *rig, alb_session *session, alb_node root, alb_error *error)
{
    alb_node obtained;
    if (!alb_node_allow(root, "format white_level_dn response obtained_s", error))
        return false;
    rig->has_white_level = alb_node_has(root, "white_level_dn");
    if (rig->has_white_level && !alb_node_number(&session->white_level_dn, root, "white_level_dn", 1e-30, 1e30, error))
        return false;
    if (alb_node_has(root, "response") && !parse_response(rig, root, error))
        return false;
    if (!alb_node_has(root, "obtained_s"))
        return true;
    if (!alb_node_object(&obtained, root, "obtained_s", error))
        return false;
    for (int i = 0; i < session->plan.shot_count; i++) {
        alb_shot *shot = &session->plan.shots[i];
        if (!alb_node_numbers(shot->obtained_s, (size_t)shot->exposure_count, obtained, shot->name, 1e-9, 1e6, error))
            return false;
        for (int e = 1; e < shot->exposure_count; e++)
            if (!(shot->obtained_s[e] > shot->obtained_s[e - 1]))
                return alb_node_fail(error, obtained, shot->name, "exposures must ascend");
    }
    return true;
}

static bool read_camera(folder_rig *rig, alb_session *session, alb_provenance *provenance, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    alb_node root;
    if (!alb_path_join(path, rig->folder, "camera.json", error))
        return false;
    if (!alb_file_exists(path))
        return true;
    alb_record *record = alb_record_read(path, error);
    const bool ok = record && alb_record_root(&root, record, error) && parse_camera(rig, session, root, error) &&
                    alb_provenance_add(provenance, path, error);
    alb_record_free(record);
    return ok;
}

// Reads one file into linear DN; *bits as alb_image_read says.
static bool read_frame(alb_image *frame, int *bits, const folder_rig *rig, const char *path, alb_error *error)
{
    if (!alb_image_read(frame, bits, path, error))
        return false;
    if (*bits == 8 && !rig->has_response)
        return alb_fail(error, ALB_BAD_DATA,
                        "%s: 8-bit values say nothing about light until their response is stated: add "
                        "\"response\" to %s/camera.json",
                        path, rig->folder);
    if (*bits != 8 && rig->has_response && !rig->is_linear)
        return alb_fail(error, ALB_BAD_DATA,
                        "%s: %s/camera.json states a response for 8-bit values, but this file holds "
                        "others",
                        path, rig->folder);
    const size_t count = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels;
    for (size_t i = 0; i < count; i++) {
        if (!isfinite((double)frame->pixels[i])) {
            const size_t at = i / (size_t)frame->channels, width = (size_t)frame->width;
            return alb_fail(error, ALB_BAD_DATA, "%s: the value at column %zu, row %zu is not finite", path, at % width,
                            at / width);
        }
        if (*bits == 8)
            frame->pixels[i] = (float)rig->table[(int)frame->pixels[i]];
    }
    return true;
}

// That every frame exists; the first one tells size and channels.
static bool survey(folder_rig *rig, alb_session *session, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    alb_image first = {0};
    int bits = 0;
    bool ok = false;
    for (int i = 0; i < session->plan.shot_count; i++)
        for (int j = 0; j < session->plan.shots[i].exposure_count * session->plan.shots[i].repeats; j++) {
            const int repeats = session->plan.shots[i].repeats;
            if (!find(path, rig, session->plan.shots[i].name, j / repeats, j % repeats, error))
                return false;
        }
    if (!find(path, rig, session->plan.shots[0].name, 0, 0, error) || !read_frame(&first, &bits, rig, path, error))
        goto done;
    if (first.channels != 1 && first.channels != 3) {
        alb_fail(error, ALB_BAD_DATA, "%s: %d channels, expected 1 or 3", path, first.channels);
        goto done;
    }
    if (!rig->has_white_level && !bits) {
        alb_fail(error, ALB_BAD_DATA,
                 "%s: floating point does not say where the sensor saturates: add \"white_level_dn\" to "
                 "%s/camera.json",
                 path, rig->folder);
        goto done;
    }
    if (!rig->has_white_level)
        session->white_level_dn = bits == 8 ? rig->table[255] : 65535;
    session->width = first.width, session->height = first.height, session->channels = first.channels;
    for (int c = 0; c < first.channels; c++) {
        if (strlen(first.name[c]) >= sizeof session->channel_names[c]) {
            alb_fail(error, ALB_BAD_DATA, "%s: channel %s: the name is too long", path, first.name[c]);
            goto done;
        }
        strcpy(session->channel_names[c], first.name[c]);
    }
    ok = true;
done:
    alb_image_free(&first);
    return ok;
}

static bool open_rig(void **state, alb_session *session, alb_provenance *provenance, const char *argument,
                     alb_error *error)
{
    folder_rig *rig = alb_allocate(1, sizeof *rig, error);
    *state = NULL;
    if (!rig)
        return false;
    snprintf(rig->folder, sizeof rig->folder, "%s", argument);
    for (size_t end = strlen(rig->folder); end > 1 && rig->folder[end - 1] == '/'; end--)
        rig->folder[end - 1] = '\0';
    const bool is_folder =
        alb_file_is_directory(rig->folder) || alb_fail(error, ALB_ACCESS, "%s: no such folder", argument);
    if (is_folder && read_camera(rig, session, provenance, error) && survey(rig, session, error)) {
        *state = rig;
        return true;
    }
    free(rig);
    return false;
}

static bool capture(alb_image *frame, void *state, const alb_session *session, int shot, int exposure, int repeat,
                    alb_error *error)
{
    const folder_rig *rig = state;
    char path[ALB_PATH_SIZE];
    int bits = 0;
    if (!find(path, rig, session->plan.shots[shot].name, exposure, repeat, error) ||
        !read_frame(frame, &bits, rig, path, error))
        return false;
    if (frame->width != session->width || frame->height != session->height)
        return alb_fail(error, ALB_BAD_DATA, "%s: %d x %d pixels, the first frame has %d x %d", path, frame->width,
                        frame->height, session->width, session->height);
    for (int c = 0; c < session->channels; c++)
        if (frame->channels != session->channels || strcmp(frame->name[c], session->channel_names[c]))
            return alb_fail(error, ALB_BAD_DATA, "%s: its channels are not those of the first frame", path);
    return true;
}

const alb_rig alb_folder_rig = {"folder", "DIR", open_rig, capture, NULL, free};
