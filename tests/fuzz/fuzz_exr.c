// OpenEXR files: base/exr.c.
#include "base/exr.h"
#include "fuzz.h"

bool fuzz_accepts(const uint8_t *bytes, size_t size, alb_error *error)
{
    alb_image image = {0};
    const bool accepted = alb_exr_read(&image, fuzz_file(bytes, size), error);
    fuzz_law(accepted == (image.pixels != NULL), "pixels exactly when read");
    fuzz_law(!accepted ||
                 (image.width > 0 && image.height > 0 && image.channels > 0 && image.channels <= ALB_CHANNELS_MAX),
             "an image has a size");
    alb_image_free(&image);
    return accepted;
}
