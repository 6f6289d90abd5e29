/* The pictures while they are taken, as a page for a browser: what the camera sees, what to hold
 * before it next, coverage, and in the end the verdict. Served by web/pages.h, in a thread of its
 * own. */
#ifndef FOVEA_CALIBRATE_LIVE_PAGE_H
#define FOVEA_CALIBRATE_LIVE_PAGE_H

#include <memory>
#include <mutex>

#include "calibrate/pictures.h"
#include "calibrate/report.h"

struct fv_web_pages;

namespace calibrate
{

struct PageOptions {
    std::string port;    /* empty: no page */
    std::string address; /* empty: 127.0.0.1 */
    std::string name, token;
    std::string certificate, certificate_key;
};

class LivePage : public Observer
{
  public:
    LivePage() = default;
    LivePage(const LivePage &) = delete;
    LivePage &operator=(const LivePage &) = delete;
    ~LivePage() override;
    /* FV_EXIT_OK, or a line is printed. */
    int open(const PageOptions &options, int views_max);

    void frame(const Grey &image, const View &view, const Advice &advice,
               const Guide &guide) override;
    void solving();
    void done(const Report &report);
    /* Until nobody has looked for some seconds, or SIGINT comes. What is printed on stdout is
     * there before. */
    void linger(const Interruption &interruption);

    /* For the server's thread: the content of a path; false: there is none. */
    bool answer(const std::string &path, std::string &type, std::string &content);

  private:
    std::string state_json() const;

    std::mutex mutex_; /* of all that follows */
    fv_web_pages *pages_ = nullptr;
    std::string stage_ = "looking", text_, trouble_, verdict_, parameters_;
    std::vector<std::string> reasons_;
    std::vector<Pixel> corners_, taken_;
    std::array<int, Guide::COLUMNS *Guide::ROWS> parts_ = {};
    Wanted wanted_;
    Thumbnail picture_;
    int width_ = 0, height_ = 0, views_max_ = 0;
    size_t views_ = 0;
    uint64_t frame_ = 0;
    double focal_deviation_ = NAN, projection_px_ = NAN;
    int64_t asked_ns_ = 0;
};

} // namespace calibrate
#endif
