/* Views from a source of Fovea or from a folder of pictures. */
#ifndef FOVEA_CALIBRATE_PICTURES_H
#define FOVEA_CALIBRATE_PICTURES_H

#include <functional>

#include "calibrate/detect.h"
#include "calibrate/guide.h"
#include "fovea/source.h"

namespace calibrate
{

struct Collection {
    std::vector<View> views;
    int width = 0, height = 0; /* of the views that are not left out for their size */
    fovea_clock clock = FOVEA_CLOCK_RECORDED; /* that the stamps of the views are on */
};

/* A picture as a view, with the reason where it shows no board. */
View view_of(const Grey &image, const Board &board, Refinement refinement, const std::string &name);

/* A picture made smaller, to at most `width_max` columns. */
Thumbnail thumbnail_of(const Grey &image, int width_max);

/* Choose the size that most pictures with a board have; the others are left out. */
void choose_size(Collection &collection);

/* Somebody who follows the pictures while they are taken. */
class Observer
{
  public:
    virtual ~Observer() = default;
    /* Of each frame: its image, the board in it, and what the guide says of it. */
    virtual void frame(const Grey &image, const View &view, const Advice &advice,
                       const Guide &guide) = 0;
};

/* Pictures of a source, taken as a guide asks for them. */
struct Guidance {
    std::vector<Model> models;    /* to solve by while they are taken */
    Observer *observer = nullptr; /* or nobody */
};

/* While one lives, SIGINT does not end the program. One at a time. */
class Interruption
{
  public:
    Interruption();
    Interruption(const Interruption &) = delete;
    Interruption &operator=(const Interruption &) = delete;
    ~Interruption();
    bool came() const;
};

/* Refuses a source by the sizes of its cameras' images, before pictures are taken of it; they are
 * not known of a folder. */
using SizeCheck = std::function<fovea_status(const std::vector<Collection> &, fovea_error *)>;
/* That the first camera's are those of `camera`, or that it can be brought to them; `file`, for
 * errors, is where that is from. */
SizeCheck size_of(const fovea_camera &camera, const std::string &file);

/* `source` is a folder of PNG, JPEG and BMP files or the URI of a source. All pictures of a folder,
 * and all frames of a recording of at most `views_max`, are taken; of other sources, the first
 * `views_max` frames whose board is new and, of a live camera, still. FOVEA_ERROR_INPUT: there is
 * none, or it cannot be read. */
fovea_status collect(const std::string &source, const Board &board, Refinement refinement,
                     int views_max, Collection &collection, fovea_error *error,
                     const SizeCheck &check = nullptr);
/* The same; of a source with more frames, at most `views_max` that the guide takes, until it is
 * done. */
fovea_status collect_guided(const std::string &source, const Board &board, Refinement refinement,
                            int views_max, const Guidance &guidance, Collection &collection,
                            fovea_error *error);
/* FOVEA_ERROR_INPUT: all pictures of the source are taken, so that there is nothing to guide. A
 * source that cannot be opened passes. */
fovea_status expect_guidance(const std::string &source, int views_max, fovea_error *error);

/* Pictures that the cameras of a rig take at the same instants: views of one index belong together.
 * One source with several cameras, or for each camera a folder or a recording of its own, of which
 * all pictures are taken in order. FOVEA_ERROR_INPUT as above, and where they are not as many;
 * `check` is asked of one source alone. */
fovea_status collect_rig(const std::vector<std::string> &sources, const Board &board, int views_max,
                         std::vector<Collection> &collections, fovea_error *error,
                         const SizeCheck &check = nullptr);

/* Name each file that a source reads: `visit` as of support/files.h. A source that cannot be opened
 * names none; that is said when its pictures are taken. */
void visit_source(const std::string &source, void (*visit)(void *, const char *), void *context);

} // namespace calibrate
#endif
