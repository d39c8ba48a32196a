#include "fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void fuzz_law(bool holds, const char *what)
{
    if (holds)
        return;
    fprintf(stderr, "broken law: %s\n", what);
    abort();
}

static char path[64];

static void remove_file(void) { remove(path); }

const char *fuzz_file(const uint8_t *bytes, size_t size)
{
    if (!*path) {
        const char *folder = access("/dev/shm", W_OK) == 0 ? "/dev/shm/" : "";
        snprintf(path, sizeof path, "%salabaster_fuzz_%ld", folder, (long)getpid());
        atexit(remove_file);
    }
    FILE *file = fopen(path, "wb");
    fuzz_law(file && fwrite(bytes, 1, size, file) == size && fclose(file) == 0, "the temporary file can be written");
    return path;
}

bool fuzz_run(const uint8_t *bytes, size_t size)
{
    alb_error error = {0};
    const bool accepted = fuzz_accepts(bytes, size, &error);
    fuzz_law(accepted == (error.status == ALB_OK), "failure and status go together");
    fuzz_law(accepted == (error.text[0] == '\0'), "failure and text go together");
    fuzz_law(!strchr(error.text, '\n'), "an error is one line");
    fuzz_law(error.status != ALB_INTERNAL, "bad input is never an internal error");
    return accepted;
}
