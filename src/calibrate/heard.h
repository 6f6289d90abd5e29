/* Messages of one channel of LCM, for as long as a calibration takes. */
#ifndef FOVEA_CALIBRATE_HEARD_H
#define FOVEA_CALIBRATE_HEARD_H

#include <functional>
#include <string>

#include "fovea/source.h"
extern "C" {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow" /* it has a struct and a function of one name */
#include "app/network/receiver.h"
#pragma GCC diagnostic pop
}

namespace calibrate
{

/* Help of the options whose values `open` takes. */
extern const char lcm_url_help[], listen_help[];

class Heard
{
  public:
    /* Gets each message, which is well-formed. */
    using Take = std::function<void(const fv_received &received)>;
    Heard() = default;
    Heard(const Heard &) = delete;
    Heard &operator=(const Heard &) = delete;
    ~Heard();
    /* `type` as "fovea.imu_t". `listen` as of the configuration: loopback, any, an interface.
     * Empty: the usual URL, and loopback. */
    fovea_status open(const std::string &url, const std::string &listen, const std::string &channel,
                      const char *type, Take take, fovea_error *error);
    /* Hand over what has come. Where nothing has, wait for it, at most `patience_ms`. */
    void handle(int patience_ms = 0);

  private:
    static void take(void *context, const fv_received *received);
    fv_receiver *receiver_ = nullptr;
    Take take_;
};

/* What to add to a stamp of `from` for `to`, both clocks of this host. */
int64_t between_clocks(fovea_clock from, fovea_clock to);

} // namespace calibrate
#endif
