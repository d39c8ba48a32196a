#include "base/image.h"
#include "base/exr.h"
#include "base/file.h"
#include "base/memory.h"
#include "base/vision.h"
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

bool alb_image_create(alb_image *image, int width, int height, const char *names, alb_error *error)
{
    *image = (alb_image){.width = width, .height = height};
    for (const char *n = names; *n;) {
        const size_t size = strcspn(n, ",");
        if (image->channels == ALB_CHANNELS_MAX || size == 0 || size >= ALB_CHANNEL_NAME)
            return alb_fail(error, ALB_BAD_DATA,
                            "channel names '%.80s': more than %d, or a name is empty or over %d bytes", names,
                            ALB_CHANNELS_MAX, ALB_CHANNEL_NAME - 1);
        memcpy(image->name[image->channels++], n, size);
        n += size + (n[size] == ',');
    }
    const double values = (double)width * height * image->channels;
    if (width < 1 || height < 1 || image->channels < 1 || values > 0x1p28)
        return alb_fail(error, ALB_BAD_DATA, "an image of %d x %d with %d channels is empty or more than 2^28 values",
                        width, height, image->channels);
    image->pixels = alb_allocate((size_t)values, sizeof *image->pixels, error);
    return image->pixels != NULL;
}

void alb_image_free(alb_image *image)
{
    free(image->pixels);
    *image = (alb_image){0};
}

int alb_image_channel(const alb_image *image, const char *name)
{
    for (int c = 0; c < image->channels; c++)
        if (!strcmp(image->name[c], name))
            return c;
    return -1;
}

bool alb_image_read(alb_image *image, int *bits, const char *path, alb_error *error)
{
    *image = (alb_image){0};
    char *bytes = NULL;
    size_t size = 0;
    int depth = 0;
    if (!alb_file_read(&bytes, &size, path, error))
        return false;
    bool ok;
    if (size == 0)
        ok = alb_fail(error, ALB_BAD_DATA, "%s: the file is empty, expected an image", path);
    else if (alb_exr_is(bytes, size))
        ok = alb_exr_decode(image, bytes, size, path, error);
    else
        ok = alb_vision_decode(image, &depth, bytes, size, path, error);
    free(bytes);
    if (bits)
        *bits = depth;
    return ok;
}

// sRGB's transfer curve (IEC 61966-2-1) of a linear value, as 0..255.
static unsigned char encode(double linear)
{
    const double v = !(linear > 0) ? 0 : linear < 1 ? linear : 1;
    return (unsigned char)lround(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055));
}

static bool write_samples(const void *samples, int width, int height, int channels, int bytes_per_sample,
                          const char *path, alb_error *error)
{
    unsigned char *png = NULL;
    size_t size = 0;
    const bool ok = alb_vision_encode_png(&png, &size, samples, width, height, channels, bytes_per_sample, error) &&
                    alb_file_write(path, png, size, error);
    free(png);
    return ok;
}

bool alb_image_write_png(const alb_image *image, double exposure, const char *path, alb_error *error)
{
    const int rgb[3] = {alb_image_channel(image, "R"), alb_image_channel(image, "G"), alb_image_channel(image, "B")};
    const bool colour = rgb[0] >= 0 && rgb[1] >= 0 && rgb[2] >= 0;
    const int channels = colour ? 3 : 1;
    const size_t count = (size_t)image->width * (size_t)image->height;
    unsigned char *samples = alb_allocate(count, (size_t)channels, error);
    if (!samples)
        return false;
    for (size_t i = 0; i < count; i++)
        for (int c = 0; c < channels; c++)
            samples[i * (size_t)channels + (size_t)c] =
                encode(exposure * (double)image->pixels[i * (size_t)image->channels + (size_t)(colour ? rgb[c] : 0)]);
    const bool ok = write_samples(samples, image->width, image->height, channels, 1, path, error);
    free(samples);
    return ok;
}

bool alb_image_write_png16(const alb_image *image, const char *path, alb_error *error)
{
    if (image->channels != 1 && image->channels != 3)
        return alb_fail(error, ALB_INTERNAL, "%s: a PNG has 1 or 3 channels, not %d", path, image->channels);
    const size_t count = (size_t)image->width * (size_t)image->height * (size_t)image->channels;
    uint16_t *samples = alb_allocate(count, sizeof *samples, error);
    if (!samples)
        return false;
    for (size_t i = 0; i < count; i++) {
        const float v = image->pixels[i];
        samples[i] = (uint16_t)(!(v > 0) ? 0 : v < 65535 ? lroundf(v) : 65535);
    }
    const bool ok = write_samples(samples, image->width, image->height, image->channels, 2, path, error);
    free(samples);
    return ok;
}
