/* Real images for tests against OpenCV: those of $FOVEA_DATA, and those that Debian's opencv-doc
 * installs. */
#ifndef FOVEA_TESTS_ORACLE_IMAGES_H
#define FOVEA_TESTS_ORACLE_IMAGES_H

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "common/data_folder.h"

inline std::string data_folder()
{
    return fv_data_folder();
}

/* All image files under a folder in order of name, at most `limit`, evenly chosen; empty where the
 * folder is absent. */
inline std::vector<std::string> images_under(const std::string &folder, size_t limit)
{
    namespace fs = std::filesystem;
    std::vector<std::string> all, chosen;
    std::error_code error;
    for (fs::recursive_directory_iterator i(folder, error), end; !error && i != end;
         i.increment(error)) {
        const std::string kind = i->path().extension().string();
        if (kind == ".png" || kind == ".jpg" || kind == ".ppm" || kind == ".pgm" || kind == ".bmp")
            all.push_back(i->path().string());
    }
    std::sort(all.begin(), all.end());
    for (size_t i = 0; i < all.size() && chosen.size() < limit;
         i += std::max<size_t>(1, all.size() / limit))
        chosen.push_back(all[i]);
    return chosen;
}

#endif
