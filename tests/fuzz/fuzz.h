// What a fuzz target is: one reader, fed with bytes. Built twice: with libFuzzer (explore.c) and with a plain main that
// replays a corpus (replay.c).
#pragma once
#include "base/error.h"
#include <stddef.h>
#include <stdint.h>

// Reads the bytes, frees what came of it; aborts where a law is broken (use `fuzz_law`). Whether they were accepted.
// Each target defines it.
bool fuzz_accepts(const uint8_t *bytes, size_t size, alb_error *error);

// Puts the bytes into a file that lives in memory where the system has such a place; returns its path.
const char *fuzz_file(const uint8_t *bytes, size_t size);

// Runs the target and holds it to the law of errors: refused with a status and one line of text, or accepted with
// neither.
bool fuzz_run(const uint8_t *bytes, size_t size);

void fuzz_law(bool holds, const char *what);
