#include "studio/guard.h"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {
namespace {

/// The time does not depend on where the texts differ.
bool equal_in_constant_time(std::string_view a, std::string_view b) {
    if (a.size() != b.size()) return false;
    unsigned difference = 0;
    for (size_t i = 0; i < a.size(); ++i)
        difference |= unsigned(static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]));
    return difference == 0;
}

/// The host of "host:port", in lower case; of an IPv6 address what is between the brackets.
std::string host_name(std::string_view host) {
    std::string_view name = host;
    if (name.starts_with('[')) {
        const size_t end = name.find(']');
        if (end == std::string_view::npos) return {};
        const std::string_view port = name.substr(end + 1);
        if (!port.empty() && port[0] != ':') return {};
        name = name.substr(1, end - 1);
    } else {
        name = name.substr(0, name.find(':'));
    }
    std::string lower(name);
    std::transform(lower.begin(), lower.end(), lower.begin(),
                   [](unsigned char c) { return char(std::tolower(c)); });
    return lower;
}

/// A file descriptor that is closed with the object.
class Descriptor {
public:
    explicit Descriptor(int fd) : fd_(fd) {}
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    int get() const { return fd_; }
    bool is_open() const { return fd_ >= 0; }

private:
    int fd_;
};

/// The opened file, or a closed one where the folder has no such regular file.
int open_in(const std::string& folder, const std::string& name) {
    const Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!directory.is_open()) return -1;
    const int fd =
        ::openat(directory.get(), name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    struct stat about {};
    if (fd >= 0 && (::fstat(fd, &about) != 0 || !S_ISREG(about.st_mode))) {
        ::close(fd);
        return -1;
    }
    return fd;
}

void check_name(const std::string& name) {
    if (!is_file_name(name))
        throw std::runtime_error(
            fmt::format("\"{}\" is no name of a file: only letters, digits, '.', '_' and '-' are "
                        "allowed, without a leading dot",
                        name));
}

[[noreturn]] void fail_missing(const std::string& name) {
    throw std::runtime_error(fmt::format("{}: there is no such file", name));
}

}  // namespace

std::string make_token() {
    std::array<unsigned char, 16> bytes{};
    if (::getrandom(bytes.data(), bytes.size(), 0) != ssize_t(bytes.size()))
        throw std::runtime_error("no random numbers for the token");
    std::string token;
    for (const unsigned char b : bytes) token += fmt::format("{:02x}", b);
    return token;
}

std::optional<Reply> refuse(const Request& r, std::string_view token) {
    const std::string host = host_name(r.host);
    if (host != "localhost" && (host.empty() || host != r.local_address))
        return Reply::error(403, "the host of the request is not this server");
    if (!r.path().starts_with("/v1")) return {};
    if (!r.origin.empty() && r.origin != "http://" + r.host)
        return Reply::error(403, "requests of other pages are refused");
    if (!r.fetch_site.empty() && r.fetch_site != "same-origin")
        return Reply::error(403, "requests of other pages are refused");
    constexpr std::string_view kScheme = "Bearer ";
    if (!r.authorization.starts_with(kScheme) ||
        !equal_in_constant_time(std::string_view(r.authorization).substr(kScheme.size()), token))
        return Reply::error(401, "the token is missing or wrong; open the printed address again");
    return {};
}

bool is_file_name(std::string_view name) {
    constexpr size_t kLongest = 128;
    if (name.empty() || name.size() > kLongest || name[0] == '.') return false;
    return std::all_of(name.begin(), name.end(), [](unsigned char c) {
        return c < 128 && (std::isalnum(c) || c == '.' || c == '_' || c == '-');
    });
}

std::string find_file_in(const std::vector<std::string>& folders, const std::string& name) {
    check_name(name);
    for (const std::string& folder : folders)
        if (const Descriptor file(open_in(folder, name)); file.is_open())
            return folder + "/" + name;
    fail_missing(name);
}

std::string read_file_in(const std::vector<std::string>& folders, const std::string& name) {
    check_name(name);
    for (const std::string& folder : folders) {
        const Descriptor file(open_in(folder, name));
        if (!file.is_open()) continue;
        std::string text(kMostBodyBytes + 1, '\0');
        size_t size = 0;
        while (size < text.size()) {
            const ssize_t n = ::read(file.get(), text.data() + size, text.size() - size);
            if (n < 0) throw std::runtime_error(fmt::format("{}: cannot be read", name));
            if (n == 0) break;
            size += size_t(n);
        }
        if (size > kMostBodyBytes)
            throw std::runtime_error(fmt::format("{}: is larger than 1 MiB", name));
        text.resize(size);
        return text;
    }
    fail_missing(name);
}

}  // namespace etendue
