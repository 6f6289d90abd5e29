#include "calibrate/heard.h"

#include "drivers/clock.h"
extern "C" {
#include "app/network/url_check.h"
}

namespace calibrate
{

#define URL_USUAL "udpm://239.255.76.67:7667"

const char lcm_url_help[] = "where lcm:CHANNEL is heard (default " URL_USUAL ")";
const char listen_help[] =
    "whom lcm:CHANNEL is heard from: loopback (default), any, or an interface";

Heard::~Heard()
{
    if (receiver_ != nullptr) fv_receiver_close(receiver_);
}

void Heard::take(void *context, const fv_received *received)
{
    static_cast<Heard *>(context)->take_(*received);
}

fovea_status Heard::open(const std::string &stated_url, const std::string &stated_listen,
                         const std::string &channel, const char *type, Take taker,
                         fovea_error *error)
{
    const std::string url = stated_url.empty() ? URL_USUAL : stated_url,
                      listen = stated_listen.empty() ? "loopback" : stated_listen;
    fv_receiver_channel row = {};
    const fovea_status well_formed = fv_transport_url_check(url.c_str(), error);
    if (well_formed != FOVEA_OK) return well_formed;
    if (!fv_receiver_listen_valid(listen.c_str()))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "--listen: found '%.100s', expected loopback, any or the name of an "
                               "interface",
                               listen.c_str());
    if (channel.empty() || channel.size() >= sizeof row.name)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "lcm: found a channel of %zu letters, expected 1 to %zu",
                               channel.size(), sizeof row.name - 1);
    channel.copy(row.name, sizeof row.name - 1);
    row.type = type;
    row.bytes_max = FV_RECEIVER_BYTES_MAX;
    row.take = take;
    row.context = this;
    take_ = std::move(taker);
    const fv_receiver_setup setup = {url.c_str(), listen.c_str(), &row, 1};
    const fovea_status status = fv_receiver_open(&setup, &receiver_, error);
    if (status == FOVEA_OK && receiver_ == nullptr)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.200s: found a URL that nothing is heard from, expected udpm:// "
                               "or tcpq://",
                               url.c_str());
    return status;
}

void Heard::handle(int patience_ms)
{
    if (patience_ms > 0) fv_receiver_handle(receiver_, patience_ms);
    while (fv_receiver_handle(receiver_, 0) > 0) {
    }
}

int64_t between_clocks(fovea_clock from, fovea_clock to)
{
    const clockid_t a = fv_clock_of(from), b = fv_clock_of(to);
    return a == b ? 0 : fv_clock_ns(b) - fv_clock_ns(a);
}

} // namespace calibrate
