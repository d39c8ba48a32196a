// The table, the JSON and the chart of bench.radiosity.
#include "base/json.h"
#include "base/plot.h"
#include "radiosity_bench.h"
#include <stdio.h>

// Sheng et al. 2014, table 1, and what is to be reached here. The paper's gallop is a frame of its animation.
static const struct {
    double precompute_s, megabytes, relight_fps, change_fps, goal_precompute_s, goal_megabytes, goal_relight_fps;
} others[TEST_SCENES] = {
    {7 * 60, 800, 14, 4, 2, 35, 40},     {22 * 60, 2700, 3, 0.25, 6, 100, 20}, {48 * 60, 8200, 0.4, 0.2, 30, 350, 4},
    {35 * 60, 2700, 3, 0.5, 6, 100, 20}, {19 * 60, 2400, 5, 0.4, 10, 100, 20},
};

void print_scene(const bench *b, int i)
{
    const figures *f = &b->of[i];
    const double precompute_s = f->forms_s + f->scatter_s;
    if (i == 0)
        printf("%-8s %8s  %-24s %-24s %-24s %-18s %s\n", "scene", "patches", "precompute F + S, s", "memory F + S, MB",
               "relight to 1e-3, fps", "products (Jacobi)", "irradiance error, %: all, by rays (stated)");
    printf("%-8s %8zu  %5.2f + %5.2f %5.0f %5.0f %7.0f %8.0f %5.0f  %9.1f %7.1f %5.0f  %9d (%d) %14.2f %.2f (%.2f)\n",
           test_scenes[i].name, f->patches, f->forms_s, f->scatter_s, others[i].precompute_s,
           others[i].goal_precompute_s, f->bytes_mb, others[i].megabytes, others[i].goal_megabytes, 1 / f->relight_s,
           others[i].relight_fps, others[i].goal_relight_fps, f->products, f->jacobi_products, f->error_percent,
           f->rays_error_percent, f->stated_percent);
    printf("%17s  total %.1f s; another translucency in %.3f s, %.2f fps (paper %.2f), %.3f of a relight; lights "
           "%.3f s\n",
           "", precompute_s, f->change_s, 1 / f->change_s, others[i].change_fps, f->change_times, f->lights_s);
    fflush(stdout);
}

void print_rest(const bench *b)
{
    static const char *const names[3] = {"lattice rays", "hemicube", "hemicube > 1e-5"};
    printf("three figures side by side: measured, paper, goal\n\n");
    printf("animation of 48 frames: %.1f s of precomputation a frame, %.1f min in all (paper 912, goal 8)\n",
           b->frame_s, 48 * b->frame_s / 60);
    printf("low-rank relighting of the bowls: %.0f fps (paper 50-80, goal 200) at a stated %.2f %%, %.0f MB, made in "
           "%.1f s\n",
           1 / b->narrow_s, b->narrow_error_percent, b->narrow_mb, b->narrow_made_s);
    printf("\nform factors of the Cornell box\n%-16s %7s %10s %10s %8s\n", "", "setting", "seconds", "MB", "error, %");
    for (int m = 0; m < 3; m++)
        for (int k = 0; k < SWEEP; k++)
            printf("%-16s %7d %10.2f %10.1f %8.2f\n", names[m], m ? hemicube_side(b, k) : 16 << (2 * k),
                   b->sweep_seconds[m][k], b->sweep_bytes[m][k], b->sweep_error[m][k]);
    const recipe *r = &b->baseline;
    printf("\n%zu patches         precompute s       MB  relight s  products  error, %%\n", r->patches);
    printf("here          %6.2f + %6.2f %8.1f %10.4f %9d %9.2f\n", b->beside.forms_s, b->beside.scatter_s,
           b->beside.bytes_mb, b->beside.relight_s, b->beside.products, b->beside.error_percent);
    printf("the recipe    %6.2f + %6.2f %8.1f %10.4f %9d %9.2f\n", r->form_seconds, r->scatter_seconds,
           (double)r->bytes / 1e6, r->solve_seconds, r->products, b->baseline_error);
    printf("\nproducts to 1e-3 in a closed room of albedo 0.5, 0.8, 0.95, 0.99\n");
    for (int k = 0; k < ALB_SOLVERS; k++)
        printf("%-18s %4.0f %4.0f %4.0f %4.0f\n", alb_solver_names[k], b->albedo_products[k][0],
               b->albedo_products[k][1], b->albedo_products[k][2], b->albedo_products[k][3]);
}

bool write_json(const bench *b, const char *path, alb_error *error)
{
    alb_json json;
    alb_json_begin(&json, NULL);
    alb_json_list(&json, "scenes");
    for (int i = 0; i < TEST_SCENES; i++) {
        const figures *f = &b->of[i];
        alb_json_object(&json, NULL);
        alb_json_string(&json, "name", test_scenes[i].name);
        alb_json_integer(&json, "patches", (long)f->patches);
        alb_json_number(&json, "form_factors_s", f->forms_s);
        alb_json_number(&json, "scattering_s", f->scatter_s);
        alb_json_number(&json, "megabytes", f->bytes_mb);
        alb_json_number(&json, "lights_s", f->lights_s);
        alb_json_number(&json, "relight_s", f->relight_s);
        alb_json_number(&json, "change_s", f->change_s);
        alb_json_number(&json, "change_over_relight", f->change_times);
        alb_json_integer(&json, "products", f->products);
        alb_json_integer(&json, "jacobi_products", f->jacobi_products);
        alb_json_number(&json, "irradiance_error_percent", f->error_percent);
        alb_json_number(&json, "rays_error_percent", f->rays_error_percent);
        alb_json_number(&json, "stated_error_percent", f->stated_percent);
        alb_json_end_object(&json);
    }
    alb_json_end_list(&json);
    alb_json_number(&json, "frame_s", b->frame_s);
    alb_json_number(&json, "low_rank_s", b->narrow_s);
    alb_json_number(&json, "low_rank_made_s", b->narrow_made_s);
    alb_json_number(&json, "low_rank_megabytes", b->narrow_mb);
    alb_json_number(&json, "low_rank_error_percent", b->narrow_error_percent);
    alb_json_object(&json, "products_by_albedo");
    for (int k = 0; k < ALB_SOLVERS; k++)
        alb_json_numbers(&json, alb_solver_names[k], b->albedo_products[k], 4);
    alb_json_end_object(&json);
    return alb_json_write(&json, path, error);
}

bool draw_chart(const bench *b, const char *path, alb_error *error)
{
    static const char *const labels[3] = {"rays", "hemicube", "below 1e-5 dropped"};
    alb_curve time[3], bytes[3], fps[3];
    double patches[TEST_SCENES], ours[TEST_SCENES], papers[TEST_SCENES], goals[TEST_SCENES];
    for (int m = 0; m < 3; m++) {
        time[m] = (alb_curve){.label = labels[m],
                              .x = b->sweep_seconds[m],
                              .y = b->sweep_error[m],
                              .count = SWEEP,
                              .mark = ALB_MARK_LINE_AND_POINTS};
        bytes[m] = time[m];
        bytes[m].x = b->sweep_bytes[m];
    }
    for (int i = 0; i < TEST_SCENES; i++) {
        patches[i] = (double)b->of[i].patches;
        ours[i] = 1 / b->of[i].relight_s, papers[i] = others[i].relight_fps, goals[i] = others[i].goal_relight_fps;
    }
    const double *const rates[3] = {ours, goals, papers};
    static const char *const who[3] = {"here, two CPU cores", "goal", "Sheng et al., two GPUs"};
    for (int m = 0; m < 3; m++)
        fps[m] =
            (alb_curve){.label = who[m], .x = patches, .y = rates[m], .count = TEST_SCENES, .mark = ALB_MARK_POINTS};
    const alb_panel panels[3] = {
        {"Cornell box: error of irradiance against seconds", "seconds", "rms error, %", true, true, 0, 0, time, 3, 1},
        {"Against memory", "MB", "rms error, %", true, true, 0, 0, bytes, 3, 1},
        {"Relighting to a residual of 1e-3, five scenes", "patches", "frames a second", true, true, 0, 0, fps, 3, 1}};
    return alb_plot_write(path, panels, 3, 800, 1100, error);
}
