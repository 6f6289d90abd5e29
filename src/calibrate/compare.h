/* Whether a calibration that exists still fits its camera, by new pictures. */
#ifndef FOVEA_CALIBRATE_COMPARE_H
#define FOVEA_CALIBRATE_COMPARE_H

#include "calibrate/verdict.h"

namespace calibrate
{

/* The camera of a file against one that is fitted to new pictures with the same model. Both project
 * the same directions; the rotation between them that no picture can tell from a turned camera is
 * taken out. */
struct Comparison {
    bool solved = false; /* the pictures determine a camera by themselves */
    std::string why_not;
    Solution fresh;           /* of the new pictures, where solved */
    double rms_px = -1;       /* of the file's camera in the new pictures; negative: not known */
    double difference_px = 0; /* of projection: worst where corners were seen */
    double difference_stdev_px = 0; /* what the new pictures know of it there */
    double uncertainty_px = 0;      /* of projection by them: worst where corners were seen */
    double focal_change = 0;        /* of the new camera against the file's, relative */
    Verdict verdict;
};

/* The model that a camera is of, by its coefficients. */
Model model_of(const fovea_camera &camera);

/* `camera` is prepared and of the pictures' size. */
Comparison compare(const fovea_camera &camera, const Board &board, const std::vector<View> &views);

/* Every second view that `whole` uses and the others, each solved by itself with the model of
 * `whole`, without the corners that it leaves out. */
Halves compare_halves(const Board &board, const std::vector<View> &views, const Solution &whole,
                      SolveOptions options);

} // namespace calibrate
#endif
