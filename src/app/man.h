/* The manual pages of `fovea`: its own, and what ends those of its commands. Init-only. */
#ifndef FOVEA_APP_MAN_H
#define FOVEA_APP_MAN_H

/* SEE ALSO, with the page of every command but `command`. */
void fv_man_see_also(const char *command);

/* The page of the program itself. */
void fv_man_program(void);

#endif
