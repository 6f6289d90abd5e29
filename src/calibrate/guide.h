/* Guidance while pictures of a board are taken: which picture is worth taking, what to hold before
 * the camera next, and when it is enough.
 *
 * A picture is taken when the board is still, sharp, elsewhere than before, and adds to what is
 * missing: a part of the image, a tilt, a distance. After each one the camera is solved; it is
 * enough when the verdict on it is *pass* and its focal length and projection are certain. The
 * limits are at the top of guide.cpp. Tilts are judged by the lengths of the board's opposite
 * sides, which needs no camera. */
#ifndef FOVEA_CALIBRATE_GUIDE_H
#define FOVEA_CALIBRATE_GUIDE_H

#include "calibrate/calibrate.h"
#include "calibrate/verdict.h"

namespace calibrate
{

/* Which side of the board is nearer to the camera. */
enum class Nearer { none, left, right, top, bottom };
constexpr int NEARER_COUNT = 5;

/* The picture that would help most. */
struct Wanted {
    int column = 1, row = 1; /* of 3 x 3 parts of the image, where the board's middle is to be */
    Nearer nearer = Nearer::none;
    bool close = true; /* the board fills about two thirds of the image's width; else a quarter */
};

struct Advice {
    bool take = false;   /* this picture: give it to Guide::add */
    std::string trouble; /* why this frame cannot be taken: blurred, moving, no board; or empty */
    std::string text;    /* what to do next, one sentence */
};

/* Where a board is in the image, as far as it is seen. */
struct Placed {
    Pixel middle;
    double width_share; /* of the image's width */
    Nearer nearer;
};

/* Between two boards, over the corners that both see; infinite where there are none. */
double mean_shift(const View &a, const View &b);
constexpr double STILL_PX = 1;    /* a board is still below this shift since the frame before, */
constexpr double NEW_SHARE = .04; /* and new from this share of the image's width on */

class Guide
{
  public:
    static constexpr int COLUMNS = 3, ROWS = 3;
    static constexpr int PART_CORNERS = 40; /* that are enough for a part of the image */
    /* `live`: frames come by the clock, and the board must be still. */
    Guide(const Board &board, const std::vector<Model> &models, int width, int height,
          int views_max, bool live);
    /* Of each frame in turn. */
    Advice look(const View &view);
    /* The last frame looked at, as a view: solves. */
    void add(const View &view);
    bool done() const
    {
        return certain_ || (int)views_.size() >= views_max_;
    }
    bool certain() const
    {
        return certain_;
    }
    const Wanted &wanted() const
    {
        return wanted_;
    }
    const std::vector<View> &views() const
    {
        return views_;
    }
    /* Corners taken by part of the image, row by row. */
    const std::array<int, COLUMNS * ROWS> &parts() const
    {
        return parts_;
    }
    /* Standard deviation over value of the focal length; NaN while there is no solution. */
    double focal_deviation() const
    {
        return focal_deviation_;
    }
    double projection_px() const
    {
        return projection_px_;
    } /* likewise, where corners were seen */

  private:
    Placed place(const View &view) const;
    bool is_new(const View &view) const;
    bool is_useful(const View &view) const;
    void choose_wanted();
    void solve_again();
    std::string instruction() const;

    Board board_;
    std::vector<Model> models_;
    int width_, height_, views_max_;
    bool live_, certain_ = false;
    View before_;
    std::vector<View> views_;
    std::array<int, COLUMNS *ROWS> parts_ = {}, blind_ = {}; /* blind: the lens has no ray there */
    std::array<int, NEARER_COUNT> tilts_ = {};
    int close_ = 0, distant_ = 0;
    int refused_ = 0; /* frames that could have been taken since the last picture */
    double focal_deviation_ = NAN, projection_px_ = NAN;
    Wanted wanted_;
};

} // namespace calibrate
#endif
