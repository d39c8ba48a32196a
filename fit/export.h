// A material as other programs read it. One row a format; each file says its unit and where its numbers come from.
#pragma once
#include "base/file.h"
#include "fit/appearance.h"

typedef struct alb_export {
    const alb_material *material;
    alb_appearance appearance;               // three channels; empty where the format wants the profiles alone
    char source[256], sha256[ALB_HASH_SIZE]; // the file the material was read from
    char identifier[ALB_NAME_SIZE];          // its name with all but ASCII letters, digits and '_' made '_'
    double unit_mm;                          // of one unit of the scene
} alb_export;

typedef struct alb_exporter {
    const char *name, *summary;
    bool wants_appearance;
    void (*put)(alb_text *text, const alb_export *exported);
} alb_exporter;

extern const alb_exporter alb_exporters[];
extern const int alb_exporter_count;
// NULL where there is none of the name.
const alb_exporter *alb_exporter_find(const char *name);

// What the exporter needs of the material that was read from `path`. Fails as alb_appearance_derive does; renderers get
// three channels: a single one stands for all, two are refused (ALB_BAD_DATA).
bool alb_export_prepare(alb_export *exported, const alb_exporter *exporter, const alb_material *material,
                        const char *path, double unit_mm, alb_error *error);
// What a reader should know, a line each behind `prefix`: the unit, the numbers in mm and how they were found.
void alb_export_put_origin(alb_text *text, const alb_export *exported, const char *prefix);

// Three numbers, one a channel.
typedef double (*alb_export_number)(const alb_export *exported, int channel);
void alb_export_put_rgb(alb_text *text, const alb_export *exported, alb_export_number number, const char *separator);

// The formats: export_burley.c, export_medium.c, export_curve.c.
void alb_export_put_cycles(alb_text *text, const alb_export *exported);
void alb_export_put_arnold(alb_text *text, const alb_export *exported);
void alb_export_put_pbrt(alb_text *text, const alb_export *exported);
void alb_export_put_mitsuba(alb_text *text, const alb_export *exported);
void alb_export_put_openpbr(alb_text *text, const alb_export *exported);
void alb_export_put_csv(alb_text *text, const alb_export *exported);
