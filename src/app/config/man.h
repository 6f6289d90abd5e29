/* Manual pages in the man(7) macros: every text is escaped, so that dashes, quotes and leading dots
 * stay themselves. Init-only. */
#ifndef FOVEA_APP_CONFIG_MAN_H
#define FOVEA_APP_CONFIG_MAN_H

/* Title and NAME section: of `fovea`, or of "fovea COMMAND" where `command` is not NULL. */
void fv_man_begin(const char *command, const char *help);
void fv_man_section(const char *title);
/* Running text; an empty line in it begins a new paragraph. */
void fv_man_text(const char *text);
/* A term in bold with its value in italics (NULL: none), and what it means; fv_man_line adds a line
 * to that. */
void fv_man_item(const char *term, const char *value, const char *text);
void fv_man_line(const char *label, const char *text);
/* Lines as they stand. */
void fv_man_example(const char *lines);
/* The usage line: "fovea COMMAND" in bold, the rest behind it. */
void fv_man_synopsis(const char *command, const char *rest);
/* SEE ALSO, with the page of every command but `command`. */
void fv_man_see_also(const char *command);

/* The page of the program itself. */
void fv_man_program(void);

#endif
