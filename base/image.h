// The one image type: float32, interleaved, named channels, one owner. All zero is empty.
#pragma once
#include "base/error.h"
#include <stddef.h>

enum { ALB_CHANNELS_MAX = 12, ALB_CHANNEL_NAME = 32 };

typedef struct alb_image {
    int width, height, channels;
    char name[ALB_CHANNELS_MAX][ALB_CHANNEL_NAME]; // "R", "variance.R", ...
    float *pixels;                                 // pixels[(y * width + x) * channels + c], row 0 on top
} alb_image;

// A zeroed image with the comma-separated channel names ("R,G,B"). Refuses more than 2^28 values.
bool alb_image_create(alb_image *image, int width, int height, const char *names, alb_error *error);
void alb_image_free(alb_image *image);
// Index of the channel, or -1.
int alb_image_channel(const alb_image *image, const char *name);
static inline float *alb_image_at(const alb_image *image, int x, int y)
{
    return image->pixels + ((size_t)y * (size_t)image->width + (size_t)x) * (size_t)image->channels;
}

// Reads EXR (exr.h) or, by its content, PNG, TIFF, JPEG, PFM or Radiance HDR. *bits (may be NULL) is 8 or 16 where the
// file holds integers, which are returned as they are (0..255, 0..65535), and 0 where it holds floating point. Channels
// are "Y" or "R,G,B" (alpha dropped) except for EXR, which keeps its own names.
bool alb_image_read(alb_image *image, int *bits, const char *path, alb_error *error);
// 8-bit sRGB-encoded PNG from linear values times `exposure`, clipped to 0..1; from the channels R,G,B or the first
// one.
bool alb_image_write_png(const alb_image *image, double exposure, const char *path, alb_error *error);
// 16-bit PNG of the values as they are, rounded and clipped to 0..65535.
bool alb_image_write_png16(const alb_image *image, const char *path, alb_error *error);
