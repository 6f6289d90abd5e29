// The list of cameras, in the process that keeps libcamera.
#ifndef FOVEA_LIBCAMERA_PRINTING_H
#define FOVEA_LIBCAMERA_PRINTING_H

// Print every camera (protocol.h). Returns the exit status.
int list_cameras();

#endif
