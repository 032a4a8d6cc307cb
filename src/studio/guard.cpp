#include "studio/guard.h"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

#include "system/descriptor.h"

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
    return lower_case(name);
}

[[noreturn]] void fail(const std::string& name, const std::string& why) {
    throw std::runtime_error(fmt::format("{}: {}", name, why));
}

/// The opened file, or a closed one where the folder has nothing of that name.
int open_in(const std::string& folder, const std::string& name) {
    const Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!directory.is_open()) return -1;
    const int fd =
        ::openat(directory.get(), name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) {
        if (errno == ENOENT) return -1;
        fail(name,
             errno == ELOOP ? "links are not followed" : std::generic_category().message(errno));
    }
    struct stat about {};
    if (::fstat(fd, &about) != 0 || !S_ISREG(about.st_mode)) {
        ::close(fd);
        fail(name, "is no regular file");
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

}  // namespace

std::string make_token() {
    std::array<unsigned char, 16> bytes{};
    if (::getrandom(bytes.data(), bytes.size(), 0) != ssize_t(bytes.size()))
        throw std::runtime_error("no random numbers for the token");
    std::string token;
    for (const unsigned char b : bytes) token += fmt::format("{:02x}", b);
    return token;
}

std::optional<Reply> refuse(const Request& r, std::string_view token,
                            const std::vector<std::string>& hosts) {
    const std::string host = host_name(r.host);
    const bool is_known = host == "localhost" || host == r.local_address ||
                          std::find(hosts.begin(), hosts.end(), host) != hosts.end();
    if (host.empty() || !is_known)
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

std::string lower_case(std::string_view text) {
    std::string lower(text);
    std::transform(lower.begin(), lower.end(), lower.begin(),
                   [](unsigned char c) { return char(std::tolower(c)); });
    return lower;
}

bool is_host_name(std::string_view name) {
    constexpr size_t kLongest = 253;
    return !name.empty() && name.size() <= kLongest &&
           std::all_of(name.begin(), name.end(), [](unsigned char c) {
               return c < 128 && (std::isalnum(c) || c == '-' || c == '.');
           });
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
    fail(name, "there is no such file");
}

std::optional<std::string> read_file_in(const std::vector<std::string>& folders,
                                        const std::string& name) {
    check_name(name);
    for (const std::string& folder : folders) {
        const Descriptor file(open_in(folder, name));
        if (!file.is_open()) continue;
        std::string text(kMostBodyBytes + 1, '\0');
        size_t size = 0;
        while (size < text.size()) {
            const ssize_t n = ::read(file.get(), text.data() + size, text.size() - size);
            if (n < 0) fail(name, std::generic_category().message(errno));
            if (n == 0) break;
            size += size_t(n);
        }
        if (size > kMostBodyBytes) fail(name, "is larger than 1 MiB");
        text.resize(size);
        return text;
    }
    return {};
}

void check_writable(const std::string& folder, const std::string& name, bool replaces) {
    check_name(name);
    struct stat about {};
    if (::lstat((folder + "/" + name).c_str(), &about) != 0) return;
    if (!S_ISREG(about.st_mode))
        throw ApiError(409, fmt::format("{} is no regular file; choose another name", name));
    if (!replaces) throw ApiError(409, fmt::format("{} exists already", name));
}

}  // namespace etendue
