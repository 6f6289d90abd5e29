/* Messages of one channel of LCM, for as long as a calibration takes. */
#ifndef FOVEA_CALIBRATE_HEARD_H
#define FOVEA_CALIBRATE_HEARD_H

#include <functional>
#include <string>

#include "fovea/source.h"

struct fv_receiver;
struct fv_received;

namespace calibrate
{

extern const char lcm_url_usual[]; /* where programs send if nothing else is said */

class Heard
{
  public:
    /* Gets each message, which is well-formed. */
    using Take = std::function<void(const uint8_t *data, uint32_t bytes)>;
    Heard() = default;
    Heard(const Heard &) = delete;
    Heard &operator=(const Heard &) = delete;
    ~Heard();
    /* `type` as "fovea.imu_t". `listen` as of the configuration: loopback, any, an interface. */
    fovea_status open(const std::string &url, const std::string &listen, const std::string &channel,
                      const char *type, Take take, fovea_error *error);
    /* Hand over what has come, and wait for it at most so long. */
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
