#include "preview.h"

#include <netdb.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <stdexcept>

#include <fmt/format.h>

#include "messages.h"
#include "usage_error.h"

namespace etendue {
namespace {

// Packet types of tev's protocol. A packet is its length (32 bits, itself included), the type, and its fields;
// numbers are little-endian, strings end with a zero.
constexpr char kCreateImage = 4;
constexpr char kUpdateImageV3 = 6;

class Packet {
public:
    explicit Packet(char type) { bytes_ += type; }
    template <class T>
    Packet& number(T value) {
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
        return *this;
    }
    Packet& text(const std::string& s) {
        bytes_.append(s.c_str(), s.size() + 1);
        return *this;
    }
    std::string finished() const {
        const auto length = uint32_t(bytes_.size() + sizeof(uint32_t));
        return std::string(reinterpret_cast<const char*>(&length), sizeof length) + bytes_;
    }

private:
    std::string bytes_;
};

constexpr const char* kChannels[] = {"R", "G", "B"};

}  // namespace

Preview::Preview(const std::string& address, const std::string& image_name, int width, int height)
    : name_(image_name), width_(width), height_(height) {
    std::string host = "127.0.0.1", port = "14158";
    if (address.starts_with("tev://")) {
        const std::string rest = address.substr(6);
        const size_t colon = rest.rfind(':');
        host = rest.substr(0, colon);
        if (colon != std::string::npos) port = rest.substr(colon + 1);
    } else if (address != "tev") {
        throw UsageError(
            fmt::format("--preview must be tev or tev://host:port, but is \"{}\"", address));
    }
    addrinfo hints{}, *found = nullptr;
    hints.ai_family = AF_UNSPEC;
    hints.ai_socktype = SOCK_STREAM;
    if (const int error = getaddrinfo(host.c_str(), port.c_str(), &hints, &found))
        throw std::runtime_error(
            fmt::format("--preview: {}:{}: {}", host, port, gai_strerror(error)));
    for (const addrinfo* a = found; a && socket_ < 0; a = a->ai_next) {
        socket_ = ::socket(a->ai_family, a->ai_socktype, a->ai_protocol);
        // Also of the connection. A viewer that does not read must not keep the rendering waiting.
        constexpr timeval kPatience{5, 0};
        ::setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof kPatience);
        if (socket_ >= 0 && ::connect(socket_, a->ai_addr, a->ai_addrlen) != 0) {
            ::close(socket_);
            socket_ = -1;
        }
    }
    freeaddrinfo(found);
    if (socket_ < 0)
        throw std::runtime_error(
            fmt::format("--preview: no viewer listens at {}:{} (is tev running?)", host, port));
    Packet packet(kCreateImage);
    packet.number<uint8_t>(1)
        .text(name_)
        .number<int32_t>(width_)
        .number<int32_t>(height_)
        .number<int32_t>(3);
    for (const char* c : kChannels) packet.text(c);
    send(packet.finished());
}

Preview::~Preview() {
    if (socket_ >= 0) ::close(socket_);
}

void Preview::send(const std::string& payload) {
    for (size_t sent = 0; sent < payload.size() && socket_ >= 0;) {
        const ssize_t n =
            ::send(socket_, payload.data() + sent, payload.size() - sent, MSG_NOSIGNAL);
        if (n <= 0) {
            const bool is_late = n < 0 && errno == EAGAIN;
            ::close(socket_);
            socket_ = -1;
            message("warning: the preview's viewer {}\n",
                    is_late ? "does not read what is sent; no more is" : "closed the connection");
            return;
        }
        sent += size_t(n);
    }
}

bool Preview::update(const Film& film, double seconds) try {
    if (last_ >= 0 && seconds - last_ < 1) return true;
    last_ = seconds;
    const std::vector<Rgb> pixels = film.image();
    Packet packet(kUpdateImageV3);
    packet.number<uint8_t>(0).text(name_).number<int32_t>(3);
    for (const char* c : kChannels) packet.text(c);
    packet.number<int32_t>(0).number<int32_t>(0).number<int32_t>(width_).number<int32_t>(height_);
    for (int64_t offset : {0, 1, 2}) packet.number(offset);
    for (int i = 0; i < 3; ++i) packet.number<int64_t>(3);
    for (const Rgb& c : pixels) packet.number(c.r).number(c.g).number(c.b);
    send(packet.finished());
    return socket_ >= 0;
} catch (const std::bad_alloc&) {
    message("warning: not enough memory for the preview\n");
    return false;
}

}  // namespace etendue
