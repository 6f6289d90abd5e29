/* Pictures that are unkind to the runtime, drawn or rendered. */
#ifndef FOVEA_TESTS_BOUNDS_PICTURES_H
#define FOVEA_TESTS_BOUNDS_PICTURES_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/camera.h"
#include "fovea/sensor.h"

/* What came with a frame of a film. */
struct film_samples {
    struct fovea_sample list[FOVEA_INPUT_SAMPLES_MAX];
    uint32_t count;
    int64_t stamp_ns; /* of the frame */
};

/* Frames of the simulated camera, in memory. */
struct film {
    uint8_t *pixels;              /* grey, one frame after the other */
    uint8_t *seconds;             /* likewise of the second camera; NULL: none */
    struct film_samples *samples; /* by frame; NULL: none come */
    int count;
    int32_t width, height;
    struct fovea_camera camera;
};

/* `count` frames of the address from `start` on, every `step`-th. Ends the program where it cannot.
 */
void film_render(struct film *film, const char *uri, int start, int step, int count);
void film_free(struct film *film);

/* Picture `n` of a run, drawn or taken from the film. */
typedef void picture_draw(uint8_t *pixels, const struct film *film, int n);
picture_draw picture_film;      /* as it is */
picture_draw picture_noise;     /* another in each frame */
picture_draw picture_drifting;  /* the same noise, which moves */
picture_draw picture_tiles;     /* a small tile over and over, which moves */
picture_draw picture_chequer;   /* of three pixels */
picture_draw picture_dots;      /* as dense as corners may be */
picture_draw picture_window;    /* of the film, but for a small window all grey */
picture_draw picture_blinks;    /* of the film, and for the last part of it all grey */
picture_draw picture_kidnapped; /* of the film, which jumps, with noise between */

#endif
