#include "v4l2.h"

/* Grey first, then what holds grey levels as they are, then what must be computed or decoded. */
#define FORMATS(ROW)                                                                               \
    ROW("GREY", V4L2_PIX_FMT_GREY, FOVEA_PIXEL_GREY8)                                              \
    ROW("NV12", V4L2_PIX_FMT_NV12, FOVEA_PIXEL_NV12)                                               \
    ROW("YU12", V4L2_PIX_FMT_YUV420, FOVEA_PIXEL_YU12)                                             \
    ROW("YUYV", V4L2_PIX_FMT_YUYV, FOVEA_PIXEL_YUYV)                                               \
    ROW("UYVY", V4L2_PIX_FMT_UYVY, FOVEA_PIXEL_UYVY)                                               \
    ROW("Y10", V4L2_PIX_FMT_Y10, FOVEA_PIXEL_Y10)                                                  \
    ROW("Y12", V4L2_PIX_FMT_Y12, FOVEA_PIXEL_Y12)                                                  \
    ROW("Y16", V4L2_PIX_FMT_Y16, FOVEA_PIXEL_Y16)                                                  \
    ROW("RGGB", V4L2_PIX_FMT_SRGGB8, FOVEA_PIXEL_BAYER_RGGB8)                                      \
    ROW("BGGR", V4L2_PIX_FMT_SBGGR8, FOVEA_PIXEL_BAYER_BGGR8)                                      \
    ROW("GRBG", V4L2_PIX_FMT_SGRBG8, FOVEA_PIXEL_BAYER_GRBG8)                                      \
    ROW("GBRG", V4L2_PIX_FMT_SGBRG8, FOVEA_PIXEL_BAYER_GBRG8)                                      \
    ROW("MJPG", V4L2_PIX_FMT_MJPEG, FOVEA_PIXEL_MJPEG)                                             \
    ROW("JPEG", V4L2_PIX_FMT_JPEG, FOVEA_PIXEL_MJPEG)                                              \
    ROW("RGB3", V4L2_PIX_FMT_RGB24, FOVEA_PIXEL_RGB24)                                             \
    ROW("BGR3", V4L2_PIX_FMT_BGR24, FOVEA_PIXEL_BGR24)

#define TABLE_ROW(name, fourcc, format) {name, fourcc, format},
#define NAME_ROW(name, fourcc, format) name,
const struct fv_v4l2_format fv_v4l2_formats[] = {FORMATS(TABLE_ROW)};
static const size_t format_count = sizeof fv_v4l2_formats / sizeof fv_v4l2_formats[0];
const char *const fv_v4l2_format_names[] = {"any", FORMATS(NAME_ROW) NULL};

const struct fv_v4l2_format *fv_v4l2_format_by_fourcc(uint32_t fourcc)
{
    for (size_t i = 0; i < format_count; i++)
        if (fv_v4l2_formats[i].fourcc == fourcc) return &fv_v4l2_formats[i];
    return NULL;
}

const char *fv_v4l2_fourcc(uint32_t fourcc, char text[5])
{
    for (int i = 0; i < 4; i++) {
        const char letter = (char)(fourcc >> (8 * i) & 0x7f);
        text[i] = '?';
        if (letter >= ' ' && letter <= '~') text[i] = letter;
    }
    text[4] = '\0';
    return text;
}
