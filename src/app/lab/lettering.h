/* Letters of the pictures that commands draw: by the plug-in fovea-text.so where it is. */
#ifndef FOVEA_APP_LAB_LETTERING_H
#define FOVEA_APP_LAB_LETTERING_H

/* Before a picture is drawn; nothing is said where there is no plug-in. Once is enough. The heap
 * is used. */
void fv_lettering_open(void);

#endif
