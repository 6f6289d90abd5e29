/* How well the calibration fits, as LCM bytes. */
#include <assert.h>
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_calibration_warning_t.h"

static_assert((int)FV_MESSAGE_CALIBRATION_CELLS_MAX <= FOVEA_CALIBRATION_WARNING_T_CELLS_MAX,
              "the limit of calibration_warning_t");

size_t fv_message_calibration_size_max(void)
{
    fovea_calibration_warning_t empty;
    memset(&empty, 0, sizeof empty);
    empty.reason = (char *)"";
    return (size_t)fovea_calibration_warning_t_encoded_size(&empty) +
           FOVEA_CALIBRATION_REASON_BYTES +
           FV_MESSAGE_CALIBRATION_CELLS_MAX * (2 * sizeof(float) + sizeof(int32_t));
}

uint32_t fv_message_calibration_encode(const struct fv_message_calibration *in, uint8_t *buffer,
                                       size_t capacity)
{
    /* lcm-gen wants an address for each row of an array of two dimensions, and knows no const. */
    float *rows[FV_MESSAGE_CALIBRATION_CELLS_MAX];
    const int32_t cells = in->columns * in->rows;
    for (int32_t i = 0; i < cells; i++)
        rows[i] = (float *)in->mean_px[i];
    const fovea_calibration_warning_t message = {
        .stamp = in->stamp,
        .camera = 0,
        .state = (int8_t)in->calibration->state,
        .reason = (char *)in->calibration->reason,
        .frames = (int64_t)in->frames,
        .rms_px = in->rms_px,
        .expected_px = in->expected_px,
        .columns = in->columns,
        .rows = in->rows,
        .cell_count = cells,
        .mean_px = rows,
        .samples = (int32_t *)in->samples,
    };
    return fv_wire_encoded(
        fovea_calibration_warning_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
