// Replays corpora through a fuzz target: replay FOLDER ... A folder that is absent is skipped, saying so.
// A file named y_* or *valid* must be accepted, n_* refused; others may be either, but must not crash, take longer than
// 20 s or need more than 1 GiB. Records refuse duplicate keys and NUL by design, so of JSONTestSuite
// y_object_duplicated_key* and y_object_escaped_null_in_key must be refused.
#include "fuzz.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

typedef struct tally {
    int accepted, refused, wrong;
} tally;

// +1: must be accepted, -1: must be refused, 0: either.
static int expectation(const char *name)
{
    if (strncmp(name, "n_", 2) == 0 || strncmp(name, "y_object_duplicated_key", 23) == 0 ||
        strncmp(name, "y_object_escaped_null", 21) == 0)
        return -1;
    if (strncmp(name, "i_", 2) == 0)
        return 0;
    return strncmp(name, "y_", 2) == 0 || (strstr(name, "valid") && !strstr(name, "invalid")) ? 1 : 0;
}

static uint8_t *read_all(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    fuzz_law(file != NULL, "a file of the corpus can be opened");
    uint8_t *bytes = NULL;
    size_t capacity = 0, got;
    *size = 0;
    do {
        capacity = capacity * 2 + 65536;
        bytes = realloc(bytes, capacity);
        fuzz_law(bytes != NULL, "memory for the corpus");
        got = fread(bytes + *size, 1, capacity - *size, file);
        *size += got;
    } while (got > 0 && *size == capacity);
    fclose(file);
    return bytes;
}

static void replay_file(tally *t, const char *folder, const char *name)
{
    char path[4096];
    size_t size;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    uint8_t *bytes = read_all(path, &size);
    uint8_t *exact = realloc(bytes, size ? size : 1); // so that AddressSanitizer sees a read past the end
    alarm(20);
    const bool accepted = fuzz_run(exact, size);
    alarm(0);
    free(exact);
    accepted ? t->accepted++ : t->refused++;
    if (expectation(name) * (accepted ? 1 : -1) < 0) {
        fprintf(stderr, "%s: %s, but must be %s\n", path, accepted ? "accepted" : "refused",
                accepted ? "refused" : "accepted");
        t->wrong++;
    }
}

static void replay_folder(tally *t, const char *folder)
{
    struct dirent **entries;
    const int count = scandir(folder, &entries, NULL, alphasort);
    if (count < 0) {
        printf("%s: absent, skipped\n", folder);
        return;
    }
    for (int i = 0; i < count; i++) {
        if (entries[i]->d_name[0] != '.')
            replay_file(t, folder, entries[i]->d_name);
        free(entries[i]);
    }
    free(entries);
}

int main(int argc, char **argv)
{
    tally t = {0};
    struct rusage usage;
    for (int i = 1; i < argc; i++)
        replay_folder(&t, argv[i]);
    getrusage(RUSAGE_SELF, &usage);
    printf("%d accepted, %d refused, %d wrong; %ld MiB at most\n", t.accepted, t.refused, t.wrong,
           usage.ru_maxrss / 1024);
    fuzz_law(t.accepted + t.refused > 0, "the corpus is not empty");
    fuzz_law(usage.ru_maxrss < 1024 * 1024, "no input needs more than 1 GiB");
    return t.wrong > 0;
}
