/* What the fake's two files share. */
#ifndef FOVEA_TESTS_FAKE_INSIDE_H
#define FOVEA_TESTS_FAKE_INSIDE_H

#include <time.h>

#include "common/fake_camera.h"

enum { FAKE_FD_FIRST = 100000 };

int64_t fake_clock_ns(clockid_t clock);
int fake_refuse(int reason); /* sets errno and returns -1 */
/* Under the lock: */
bool fake_alive(const struct fake_camera *camera); /* its open descriptor is good */
bool fake_frame_ready(const struct fake_camera *camera);
int fake_stream(struct fake_camera *camera, bool on);
int fake_answer(struct fake_camera *camera, unsigned long request, void *argument);

#endif
