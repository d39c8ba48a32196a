// OpenEXR by OpenEXRCore. The library's own messages are caught and become ours; sizes are checked before anything is
// allocated, since a damaged header may claim any.
#include "base/exr.h"
#include "base/file.h"
#include "base/memory.h"
#include <openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct reader {
    exr_context_t context;
    exr_decode_pipeline_t decoder;
    bool decoding;
    const char *path;
    const char *bytes; // reading: the whole file
    size_t size;
    char problem[256]; // the library's latest message
} reader;

// The library tells of a failure while it holds the context's lock, so that the context cannot be asked whose it is:
// the thread knows. (A full disk would otherwise wait for itself.)
static _Thread_local reader *current;

static void keep_message(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)context, (void)code;
    if (current)
        snprintf(current->problem, sizeof current->problem, "%s", message);
}

bool alb_exr_is(const void *bytes, size_t size) { return size >= 4 && !memcmp(bytes, "\x76\x2f\x31\x01", 4); }

static bool damaged(const reader *r, exr_result_t code, alb_error *error)
{
    const char *why = r->problem[0] ? r->problem : exr_get_default_error_message(code);
    return alb_fail(error, ALB_BAD_DATA, "%s: not a readable OpenEXR file: %s", r->path, why);
}

// R, G, B, Y first, then by name, as the file has them.
static int rank(const char *name)
{
    static const char *const first[] = {"R", "G", "B", "Y"};
    for (int i = 0; i < 4; i++)
        if (!strcmp(name, first[i]))
            return i;
    return 4;
}

static bool prepare(alb_image *image, reader *r, alb_error *error)
{
    int parts = 0;
    exr_storage_t storage;
    exr_attr_box2i_t window;
    const exr_attr_chlist_t *list = NULL;
    exr_result_t code = exr_get_count(r->context, &parts);
    if (code || (code = exr_get_storage(r->context, 0, &storage)) ||
        (code = exr_get_data_window(r->context, 0, &window)) || (code = exr_get_channels(r->context, 0, &list)))
        return damaged(r, code, error);
    if (parts != 1 || (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED))
        return alb_fail(error, ALB_BAD_DATA, "%s: deep or multi-part OpenEXR; save it as one flat part", r->path);
    if (list->num_channels < 1 || list->num_channels > ALB_CHANNELS_MAX)
        return alb_fail(error, ALB_BAD_DATA, "%s: %d channels, expected 1 to %d", r->path, list->num_channels,
                        ALB_CHANNELS_MAX);
    char names[ALB_CHANNELS_MAX * (ALB_CHANNEL_NAME + 1)] = "";
    for (int order = 0; order <= 4; order++)
        for (int c = 0; c < list->num_channels; c++) {
            const exr_attr_chlist_entry_t *entry = &list->entries[c];
            if (rank(entry->name.str) != order)
                continue;
            if (entry->x_sampling != 1 || entry->y_sampling != 1)
                return alb_fail(error, ALB_BAD_DATA, "%s: channel %s is subsampled; save it at full resolution",
                                r->path, entry->name.str);
            if (entry->name.length >= ALB_CHANNEL_NAME || strchr(entry->name.str, ','))
                return alb_fail(error, ALB_BAD_DATA, "%s: channel name '%.40s' is over %d bytes or has a comma",
                                r->path, entry->name.str, ALB_CHANNEL_NAME - 1);
            snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", *names ? "," : "", entry->name.str);
        }
    const long width = (long)window.max.x - window.min.x + 1, height = (long)window.max.y - window.min.y + 1;
    if (width < 1 || height < 1 || width > 1 << 20 || height > 1 << 20)
        return alb_fail(error, ALB_BAD_DATA, "%s: data window of %ld x %ld pixels", r->path, width, height);
    return alb_image_create(image, (int)width, (int)height, names, error);
}

// Decodes one chunk (block of scan lines, or tile) whose top left pixel is (x, y) of the image.
static bool decode(alb_image *image, reader *r, const exr_chunk_info_t *chunk, int x, int y, alb_error *error)
{
    exr_result_t code = r->decoding ? exr_decoding_update(r->context, 0, chunk, &r->decoder)
                                    : exr_decoding_initialize(r->context, 0, chunk, &r->decoder);
    if (code)
        return damaged(r, code, error);
    for (int c = 0; c < r->decoder.channel_count; c++) {
        exr_coding_channel_info_t *channel = &r->decoder.channels[c];
        const int to = alb_image_channel(image, channel->channel_name);
        if (to < 0 || x < 0 || y < 0 || x + channel->width > image->width || y + channel->height > image->height)
            return alb_fail(error, ALB_BAD_DATA, "%s: a block lies outside the image", r->path);
        channel->decode_to_ptr = (uint8_t *)(alb_image_at(image, x, y) + to);
        channel->user_bytes_per_element = sizeof(float);
        channel->user_data_type = EXR_PIXEL_FLOAT;
        channel->user_pixel_stride = image->channels * (int)sizeof(float);
        channel->user_line_stride = image->width * channel->user_pixel_stride;
    }
    if (!r->decoding && (code = exr_decoding_choose_default_routines(r->context, 0, &r->decoder)))
        return r->decoding = true, damaged(r, code, error);
    r->decoding = true;
    code = exr_decoding_run(r->context, 0, &r->decoder);
    return !code || damaged(r, code, error);
}

static bool read_lines(alb_image *image, reader *r, int top, alb_error *error)
{
    int32_t lines = 0;
    exr_result_t code = exr_get_scanlines_per_chunk(r->context, 0, &lines);
    if (code || lines < 1)
        return damaged(r, code, error);
    for (int y = 0; y < image->height; y += lines) {
        exr_chunk_info_t chunk;
        if ((code = exr_read_scanline_chunk_info(r->context, 0, top + y, &chunk)))
            return damaged(r, code, error);
        if (!decode(image, r, &chunk, 0, chunk.start_y - top, error))
            return false;
    }
    return true;
}

static bool read_tiles(alb_image *image, reader *r, alb_error *error)
{
    uint32_t width = 0, height = 0;
    exr_tile_level_mode_t level;
    exr_tile_round_mode_t round;
    exr_result_t code = exr_get_tile_descriptor(r->context, 0, &width, &height, &level, &round);
    if (code || !width || !height || width > 1 << 20 || height > 1 << 20)
        return damaged(r, code, error);
    for (int ty = 0, y = 0; y < image->height; ty++, y += (int)height)
        for (int tx = 0, x = 0; x < image->width; tx++, x += (int)width) {
            exr_chunk_info_t chunk;
            if ((code = exr_read_tile_chunk_info(r->context, 0, tx, ty, 0, 0, &chunk)))
                return damaged(r, code, error);
            if (!decode(image, r, &chunk, x, y, error))
                return false;
        }
    return true;
}

static int64_t size_of(exr_const_context_t context, void *user)
{
    (void)context;
    return (int64_t)((const reader *)user)->size;
}

// As pread: fewer bytes than asked for at the end.
static int64_t read_at(exr_const_context_t context, void *user, void *buffer, uint64_t size, uint64_t offset,
                       exr_stream_error_func_ptr_t fail)
{
    (void)context, (void)fail;
    const reader *r = user;
    const uint64_t left = offset < r->size ? r->size - offset : 0, count = size < left ? size : left;
    if (count)
        memcpy(buffer, r->bytes + offset, count);
    return (int64_t)count;
}

bool alb_exr_decode(alb_image *image, const void *bytes, size_t size, const char *name, alb_error *error)
{
    *image = (alb_image){0};
    reader r = {.path = name, .bytes = bytes, .size = size};
    exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
    options.error_handler_fn = keep_message;
    options.user_data = &r;
    options.size_fn = size_of;
    options.read_fn = read_at;
    options.max_image_width = options.max_image_height = 1 << 20;
    options.max_tile_width = options.max_tile_height = 1 << 14;
    bool ok = false;
    current = &r;
    const exr_result_t code = exr_start_read(&r.context, name, &options);
    if (code) {
        damaged(&r, code, error);
        goto done;
    }
    if (!prepare(image, &r, error))
        goto done;
    exr_storage_t storage;
    exr_attr_box2i_t window;
    exr_get_storage(r.context, 0, &storage);
    exr_get_data_window(r.context, 0, &window);
    ok = storage == EXR_STORAGE_TILED ? read_tiles(image, &r, error) : read_lines(image, &r, window.min.y, error);
done:
    if (r.decoding)
        exr_decoding_destroy(r.context, &r.decoder);
    if (r.context)
        exr_finish(&r.context);
    current = NULL;
    if (!ok)
        alb_image_free(image);
    return ok;
}

bool alb_exr_read(alb_image *image, const char *path, alb_error *error)
{
    char *bytes = NULL;
    size_t size = 0;
    *image = (alb_image){0};
    const bool ok = alb_file_read(&bytes, &size, path, error) && alb_exr_decode(image, bytes, size, path, error);
    free(bytes);
    return ok;
}

typedef exr_result_t (*compressor)(exr_encode_pipeline_t *);

// OpenEXRCore 3.1 keeps a block's compressed form when it is exactly as long as the block, and readers, 3.1 itself
// among them, then take it for the block: about one noisy block in four thousand would come back as garbage.
static exr_result_t compress_or_keep(exr_encode_pipeline_t *encoder)
{
    const exr_result_t code = ((const compressor *)encoder->encoding_user_data)[0](encoder);
    if (!code && encoder->compressed_bytes == encoder->packed_bytes)
        memcpy(encoder->compressed_buffer, encoder->packed_buffer, encoder->packed_bytes);
    return code;
}

static exr_result_t write_lines(const alb_image *image, exr_context_t context, exr_encode_pipeline_t *encoder)
{
    exr_result_t code;
    int32_t lines = 0;
    compressor usual = NULL;
    if ((code = exr_get_scanlines_per_chunk(context, 0, &lines)))
        return code;
    for (int y = 0; y < image->height; y += lines) {
        exr_chunk_info_t chunk;
        if ((code = exr_write_scanline_chunk_info(context, 0, y, &chunk)) ||
            (code = y ? exr_encoding_update(context, 0, &chunk, encoder)
                      : exr_encoding_initialize(context, 0, &chunk, encoder)))
            return code;
        for (int c = 0; c < encoder->channel_count; c++) {
            exr_coding_channel_info_t *channel = &encoder->channels[c];
            channel->encode_from_ptr =
                (const uint8_t *)(alb_image_at(image, 0, y) + alb_image_channel(image, channel->channel_name));
            channel->user_bytes_per_element = sizeof(float);
            channel->user_data_type = EXR_PIXEL_FLOAT;
            channel->user_pixel_stride = image->channels * (int)sizeof(float);
            channel->user_line_stride = image->width * channel->user_pixel_stride;
        }
        if (!y) {
            if ((code = exr_encoding_choose_default_routines(context, 0, encoder)))
                return code;
            usual = encoder->compress_fn;
            encoder->compress_fn = compress_or_keep;
            encoder->encoding_user_data = &usual;
        }
        if ((code = exr_encoding_run(context, 0, encoder)))
            return code;
    }
    return EXR_ERR_SUCCESS;
}

static exr_result_t write_file(const alb_image *image, const char *provenance, exr_context_t context)
{
    int part = 0;
    exr_result_t code;
    if ((code = exr_add_part(context, "image", EXR_STORAGE_SCANLINE, &part)) ||
        (code = exr_initialize_required_attr_simple(context, 0, image->width, image->height, EXR_COMPRESSION_ZIP)))
        return code;
    for (int c = 0; c < image->channels; c++)
        if ((code = exr_add_channel(context, 0, image->name[c], EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LINEAR, 1, 1)))
            return code;
    if ((provenance && (code = exr_attr_set_string(context, 0, "provenance", provenance))) ||
        (code = exr_write_header(context)))
        return code;
    exr_encode_pipeline_t encoder = {0};
    code = write_lines(image, context, &encoder);
    exr_encoding_destroy(context, &encoder);
    return code;
}

bool alb_exr_write(const alb_image *image, const char *provenance, const char *path, alb_error *error)
{
    char temporary[ALB_PATH_SIZE];
    reader r = {.path = path}; // only its message is used
    exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
    options.error_handler_fn = keep_message;
    if (!alb_file_begin(temporary, path, error))
        return false;
    current = &r;
    exr_result_t code = exr_start_write(&r.context, temporary, EXR_WRITE_FILE_DIRECTLY, &options);
    if (!code)
        code = write_file(image, provenance, r.context);
    if (r.context) {
        const exr_result_t finished = exr_finish(&r.context);
        code = code ? code : finished;
    }
    current = NULL;
    if (code) {
        alb_file_abandon(temporary);
        return alb_fail(error, ALB_ACCESS, "%s: cannot be written: %s", path,
                        r.problem[0] ? r.problem : exr_get_default_error_message(code));
    }
    return alb_file_commit(temporary, path, error);
}
