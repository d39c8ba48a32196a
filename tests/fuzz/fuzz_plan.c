// Plans of a capture: capture/plan.c.
#include "capture/session.h"
#include "fuzz.h"

bool fuzz_accepts(const uint8_t *bytes, size_t size, alb_error *error)
{
    static alb_plan plan;
    plan = (alb_plan){0};
    if (!alb_plan_read(&plan, fuzz_file(bytes, size), error))
        return false;
    fuzz_law(plan.shot_count > 0 && plan.shot_count <= ALB_SHOTS_MAX, "a plan has shots");
    for (int i = 0; i < plan.shot_count; i++) {
        const alb_shot *shot = &plan.shots[i];
        fuzz_law(shot->exposure_count > 0 && shot->exposure_count <= ALB_EXPOSURES_MAX, "a shot has exposures");
        for (int e = 0; e < shot->exposure_count; e++)
            fuzz_law(shot->exposures_s[e] > 0, "an exposure is positive");
    }
    return true;
}
