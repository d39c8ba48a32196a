// KIND:ARGUMENT -> the rig of that kind.
#include "capture/rig.h"
#include <string.h>

static const alb_rig *const rigs[] = {&alb_virtual_rig, &alb_folder_rig};

const alb_rig *alb_rig_find(const char **argument, const char *text, alb_error *error)
{
    const char *colon = strchr(text, ':');
    for (size_t i = 0; colon && i < sizeof rigs / sizeof *rigs; i++)
        if (strlen(rigs[i]->kind) == (size_t)(colon - text) && !strncmp(text, rigs[i]->kind, (size_t)(colon - text))) {
            *argument = colon + 1;
            if (**argument)
                return rigs[i];
        }
    alb_fail(error, ALB_USAGE, "--rig %.200s: expected %s:%s or %s:%s", text, rigs[0]->kind, rigs[0]->argument,
             rigs[1]->kind, rigs[1]->argument);
    return NULL;
}
