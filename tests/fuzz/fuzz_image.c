// Every other picture: base/image.c and, behind it, OpenCV.
#include "base/image.h"
#include "fuzz.h"

bool fuzz_accepts(const uint8_t *bytes, size_t size, alb_error *error)
{
    alb_image image = {0};
    int bits = -1;
    const bool accepted = alb_image_read(&image, &bits, fuzz_file(bytes, size), error);
    fuzz_law(accepted == (image.pixels != NULL), "pixels exactly when read");
    fuzz_law(!accepted || bits == 0 || bits == 8 || bits == 16, "bits are 0, 8 or 16");
    alb_image_free(&image);
    return accepted;
}
