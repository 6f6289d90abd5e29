/* Files that a command writes, whole or not at all. */
#ifndef FOVEA_CALIBRATE_TEXT_FILE_H
#define FOVEA_CALIBRATE_TEXT_FILE_H

#include <string>

namespace calibrate
{

/* FV_EXIT_OK, or a line is printed and the exit status is returned; what was at `path` stays then.
 */
int write_text(const std::string &path, const std::string &text);

} // namespace calibrate
#endif
