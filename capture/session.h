// A session: what capture leaves behind and calibrate reads. A folder with session.json and frames/*.exr.
//
// Frames hold raw sensor values in DN (digital numbers), channels R,G,B (or Y), black level included. File names are
// frames/<shot>_e<exposure index>_r<repeat>.exr.
#pragma once
#include "base/error.h"
#include "base/file.h"
#include "base/json.h"
#include "base/record.h"

enum { ALB_SHOTS_MAX = 32, ALB_EXPOSURES_MAX = 16, ALB_NAME_SIZE = 48 };

// Which face of the slab the camera sees; the projector always lights the front.
typedef enum alb_side { ALB_REFLECTION, ALB_TRANSMISSION, ALB_SIDES } alb_side;
extern const char *const alb_side_names[ALB_SIDES]; // "reflection", "transmission"

// What stands at the sample's place.
typedef enum alb_target {
    ALB_TARGET_SLAB,
    ALB_TARGET_WHITE,    // Lambertian reference of known reflectance, in the plane of the slab's front face
    ALB_TARGET_DIFFUSER, // an evenly lit field: shows vignetting
    ALB_TARGET_BOARD,    // chessboard
    ALB_TARGET_CAP,      // lens cap: dark frames
    ALB_TARGETS
} alb_target;
extern const char *const alb_target_names[ALB_TARGETS]; // "slab", "white_reference", "diffuser", "board", "cap"

// The slab's faces, which decide the directions that light leaves in.
typedef enum alb_finish {
    ALB_FINISH_SMOOTH, // polished: Fresnel's law bends and reflects what leaves
    ALB_FINISH_GROUND, // rough: radiance alike in all directions
    ALB_FINISHS
} alb_finish;
extern const char *const alb_finish_names[ALB_FINISHS]; // "smooth", "ground"
// The key "finish" of a record; smooth where it is not there.
bool alb_finish_read(alb_finish *finish, alb_node object, alb_error *error);

typedef enum alb_pattern_kind {
    ALB_PATTERN_BLACK,
    ALB_PATTERN_WHITE,
    ALB_PATTERN_SPOT,       // a disc of projector pixels about the middle
    ALB_PATTERN_GRID,       // columns x rows such discs, pitch_px apart
    ALB_PATTERN_CHESSBOARD, // evenly lit photographs of the printed board
    ALB_PATTERNS
} alb_pattern_kind;
extern const char *const alb_pattern_names[ALB_PATTERNS]; // "black", "white", "spot", "grid", "chessboard"

typedef struct alb_pattern {
    alb_pattern_kind kind;
    double diameter_px; // spot and grid: diameter of a disc in projector pixels
    int columns, rows;  // grid
    double pitch_px;    // grid
} alb_pattern;

// Whether two shots project the same light: what pairs the slab with its photograph on the white reference.
bool alb_pattern_same(const alb_pattern *a, const alb_pattern *b);
// Whether a disc of the diameter lights pixel (x, y) of the ceil(diameter) pixels across and down about its middle:
// those whose centre it holds; the one there is, where it is that small.
bool alb_disc_lights(double diameter_px, int x, int y);

// One line of the plan: a pattern on a target, at several exposures, several times.
typedef struct alb_shot {
    char name[ALB_NAME_SIZE]; // [a-z0-9_]+, unique
    alb_side side;
    alb_target target;
    alb_pattern pattern;
    double exposures_s[ALB_EXPOSURES_MAX];
    double obtained_s[ALB_EXPOSURES_MAX]; // what the camera says it did; used for all arithmetic
    int exposure_count;
    int repeats;  // frames at each exposure; for a hand-held board each repeat is another pose
    bool in_hand; // board: true for free poses (intrinsics), false when it lies in the plane of the face that is seen
} alb_shot;

typedef struct alb_plan {
    char sample[ALB_NAME_SIZE]; // name of the material
    double thickness_mm;
    double refractive_index;
    alb_finish finish;
    double white_reflectance[3];   // of the white reference, per channel
    int board_columns, board_rows; // inner corners
    double board_square_mm;
    alb_shot shots[ALB_SHOTS_MAX];
    int shot_count;
} alb_plan;

typedef struct alb_session {
    char folder[ALB_PATH_SIZE];
    char rig[ALB_PATH_SIZE]; // "virtual:wax.json": kind and last component
    int width, height, channels;
    char channel_names[3][8];
    double white_level_dn; // values at or above are saturated
    alb_plan plan;
} alb_session;

// Reads a plan file (PLAN.json: sample, white_reference, board, shots). ALB_BAD_DATA names file, line and key.
bool alb_plan_read(alb_plan *plan, const char *path, alb_error *error);
// Writes and reads session.json inside session->folder. Reading checks that every frame exists, not its content.
bool alb_session_write(const alb_session *session, const alb_provenance *provenance, alb_error *error);
bool alb_session_read(alb_session *session, const char *folder, alb_error *error);
// Path of a frame.
bool alb_session_frame(char path[ALB_PATH_SIZE], const alb_session *session, const alb_shot *shot, int exposure,
                       int repeat, alb_error *error);
