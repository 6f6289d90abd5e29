/* Real images for tests against OpenCV: those of $FOVEA_DATA, and those that Debian's opencv-doc
 * installs. */
#ifndef FOVEA_TESTS_ORACLE_IMAGES_H
#define FOVEA_TESTS_ORACLE_IMAGES_H

#include <algorithm>
#include <cstdio>
#include <cstdlib>
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

/* What a program with the arguments [FOLDER [LIMIT]] compares on: at most LIMIT images of FOLDER,
 * 0: all; `most` of the data folder, or of opencv-doc where that is absent. What is not there is
 * named as skipped. */
inline std::vector<std::string> images_of(int argc, char **argv, size_t most)
{
    const size_t limit = argc > 2 ? std::strtoul(argv[2], nullptr, 10) : most;
    const std::string folder = argc > 1 ? argv[1] : data_folder();
    std::vector<std::string> names = images_under(folder, limit == 0 ? 1000000 : limit);
    if (!names.empty() || argc > 1) return names;
    std::printf("SKIPPED images of %s: not there\n", folder.c_str());
    names = images_under("/usr/share/doc/opencv-doc/examples/data", most);
    if (names.empty()) std::printf("SKIPPED images of opencv-doc: not installed\n");
    return names;
}

#endif
