// Measured profiles as CSV: fit/table.c.
#include "fit/table.h"
#include "fuzz.h"

#include <math.h>

bool fuzz_accepts(const uint8_t *bytes, size_t size, alb_error *error)
{
    alb_readings readings = {0};
    const bool accepted = alb_table_read(&readings, fuzz_file(bytes, size), error);
    for (int i = 0; accepted && i < readings.count; i++)
        fuzz_law(isfinite(readings.r_mm[i]) && isfinite(readings.value[i]), "a reading is finite");
    alb_readings_free(&readings);
    return accepted;
}
