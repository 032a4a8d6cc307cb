#include "system/output_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <new>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "system/descriptor.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

std::string reason(int error) {
    return std::generic_category().message(error);
}

// -- Names of the temporary files, where a signal handler finds them.

struct Slot {
    enum State { Free, Claimed, Named };
    std::atomic<int> state{Free};
    char name[PATH_MAX];
};
Slot slots[32];
static_assert(std::atomic<int>::is_always_lock_free);

/// -1 if the name is too long or all slots are taken: the handler then leaves the file behind.
int claim_slot(const std::string& name) {
    if (name.size() >= sizeof Slot::name) return -1;
    for (int i = 0; i < int(std::size(slots)); ++i) {
        int expected = Slot::Free;
        if (!slots[i].state.compare_exchange_strong(expected, Slot::Claimed)) continue;
        std::memcpy(slots[i].name, name.c_str(), name.size() + 1);
        slots[i].state = Slot::Named;
        return i;
    }
    return -1;
}

void free_slot(int& slot) {
    if (slot >= 0) slots[slot].state = Slot::Free;
    slot = -1;
}

// -- Names and descriptors.

/// The open descriptor that a name such as /dev/stdout or /proc/self/fd/1 means.
std::optional<int> open_descriptor(const fs::path& path) {
    const fs::path own = fmt::format("/proc/{}/fd", ::getpid());
    std::error_code error;
    if (!path.has_filename() || fs::canonical(path.parent_path(), error) != own || error) return {};
    const std::string name = path.filename().string();
    if (name.empty() || name.size() > 6 || name.find_first_not_of("0123456789") != name.npos)
        return {};
    return std::stoi(name);
}

bool is_writable(const fs::path& path) {
    return ::faccessat(AT_FDCWD, path.c_str(), W_OK, AT_EACCESS) == 0;
}

/// Also where the descriptor is one that does not wait, as a pipe may be that several programs share.
bool write_all(int file, const char* data, size_t size) {
    while (size > 0) {
        const ssize_t n = ::write(file, data, size);
        if (n < 0 && errno == EAGAIN) {
            pollfd waiting{file, POLLOUT, 0};
            if (::poll(&waiting, 1, -1) < 0 && errno != EINTR) return false;
            continue;
        }
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        data += n, size -= size_t(n);
    }
    return true;
}

/// Some file systems cannot do this.
bool sync(int file) {
    while (::fsync(file) != 0)
        if (errno != EINTR) return errno == EINVAL || errno == ENOTSUP || errno == EROFS;
    return true;
}

/// Writes the rest of one file to another.
bool copy(int from, int to) {
    char buffer[1 << 16];
    while (true) {
        const ssize_t n = ::read(from, buffer, sizeof buffer);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return n == 0;
        if (!write_all(to, buffer, size_t(n))) return false;
    }
}

/// Gives a new file the owner and the permissions of the one that it replaces. Returns an error (errno), or 0.
int keep_permissions(int file, const struct stat& old) {
    struct stat own;
    if (::fstat(file, &own) != 0) return errno;
    // Owner and group first, since a change of these may clear bits of the mode. Only root can keep every owner.
    mode_t mode = old.st_mode & 07777;
    if (own.st_gid != old.st_gid && ::fchown(file, uid_t(-1), old.st_gid) != 0)
        // Another group has no more rights than everybody.
        mode = (mode & ~mode_t(S_ISGID | S_IRWXG)) | ((mode & S_IRWXO) << 3);
    if (own.st_uid != old.st_uid && ::fchown(file, old.st_uid, gid_t(-1)) != 0)
        mode &= ~mode_t(S_ISUID);
    return ::fchmod(file, mode) == 0 || errno == EPERM ? 0 : errno;
}

/// Where links lead, also if that file is still to be made. Stops at the name of an open descriptor.
fs::path follow_links(fs::path path, std::error_code& error) {
    constexpr int kMostLinks = 40;  // As the kernel.
    std::error_code ignored;
    for (int followed = 0;
         fs::is_symlink(fs::symlink_status(path, ignored)) && !open_descriptor(path); ++followed) {
        if (followed == kMostLinks)
            error = std::make_error_code(std::errc::too_many_symbolic_link_levels);
        const fs::path to = error ? fs::path() : fs::read_symlink(path, error);
        if (error) break;
        path = path.parent_path() / to;
    }
    return path;
}

}  // namespace

OutputFile::OutputFile(const std::string& path, Links links) : path_(path) {
    if (path.empty()) fail("the name is empty");
    fs::path target = path;
    std::error_code error;
    struct stat found;
    // Follows links under the rules of the kernel, which refuses those of other users in folders such as /tmp.
    bool exists = ::stat(path.c_str(), &found) == 0;
    if (!exists && errno != ENOENT) fail(reason(errno));
    if (links == Links::Follow) {
        target = follow_links(path, error);
        if (error) fail(error.message());
        if (open_descriptor(target)) {
            check_in_place(target.string());
            return;
        }
    } else if (fs::is_symlink(fs::symlink_status(target, error))) {
        exists = false;
    }
    if (exists && S_ISDIR(found.st_mode)) fail("there is a folder of that name");
    if (exists && !S_ISREG(found.st_mode)) {
        check_in_place(target.string());
        return;
    }
    if (exists) {
        if (!is_writable(target)) fail(reason(errno));
        replaces_ = true;
    }
    if (const fs::path name = target.filename(); name.empty() || name == "." || name == "..")
        fail("the name is that of a folder");
    const fs::path folder = target.parent_path();
    if (!folder.empty() && !fs::is_directory(folder, error)) {
        fs::create_directories(folder, error);
        if (error) fail("cannot create its folder: " + error.message());
    }
    target_ = fs::absolute(target, error).string();
    if (error) fail(error.message());
    open_temporary();
    if (exists) error_ = keep_permissions(file_, found);
}

OutputFile::~OutputFile() {
    if (file_ >= 0) ::close(file_);
    if (!temporary_.empty() && !is_committed_) ::unlink(temporary_.c_str());
    free_slot(slot_);
}

void OutputFile::fail(const std::string& why) const {
    throw std::runtime_error(fmt::format("cannot write \"{}\": {}", path_, why));
}

void OutputFile::open_temporary() {
    const fs::path folder = fs::path(target_).parent_path();
    // With the permissions of a new file, as the user's mask sets them; mkostemp() would make a private one.
    for (int attempt = 0; file_ < 0; ++attempt) {
        // A name that nobody can predict and that is not longer than others in the folder may be.
        uint64_t random = 0;
        if (::getrandom(&random, sizeof random, 0) != sizeof random)
            fail("the system has no random numbers");
        temporary_ = (folder / fmt::format(".etendue-{:016x}.part", random)).string();
        slot_ = claim_slot(temporary_);
        file_ =
            ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
        if (file_ >= 0) return;
        const int error = errno;
        temporary_.clear();
        free_slot(slot_);
        if ((error != EEXIST && error != EINTR) || attempt > 100)
            fail(fmt::format("no file can be made in its folder: {}", reason(error)));
    }
}

// Opened by commit() only, since a named pipe is opened once, when somebody reads it.
void OutputFile::check_in_place(const std::string& target) {
    target_ = target;
    if (!is_writable(target)) fail(reason(errno));
}

bool OutputFile::write(const void* data, size_t size) noexcept {
    if (error_ != 0) return false;
    if (is_in_place()) {
        try {
            if (memory_.size() < position_ + size) memory_.resize(position_ + size);
        } catch (const std::exception&) {
            error_ = ENOMEM;
            return false;
        }
        if (size > 0) std::memcpy(memory_.data() + position_, data, size);
    } else if (!write_all(file_, static_cast<const char*>(data), size)) {
        error_ = errno != 0 ? errno : EIO;
        return false;
    }
    position_ += size;
    return true;
}

bool OutputFile::seek(uint64_t position) noexcept {
    if (error_ != 0) return false;
    if (!is_in_place() && ::lseek(file_, off_t(position), SEEK_SET) < 0) {
        error_ = errno;
        return false;
    }
    position_ = position;
    return true;
}

void OutputFile::write_in_place() {
    const std::optional<int> descriptor = open_descriptor(target_);
    // A descriptor is written at its own position, after what was printed before.
    if (descriptor) std::fflush(stdout);
    file_ = descriptor ? ::fcntl(*descriptor, F_DUPFD_CLOEXEC, 0)
                       : ::open(target_.c_str(), O_WRONLY | O_NOCTTY | O_CLOEXEC);
    if (file_ < 0 || !write_all(file_, memory_.data(), memory_.size())) fail(reason(errno));
    close();
}

void OutputFile::close() {
    const int file = file_;
    file_ = -1;
    if (::close(file) != 0 && errno != EINTR) fail(reason(errno));
}

void OutputFile::commit() {
    if (error_ != 0) fail(reason(error_));
    if (is_in_place()) return write_in_place();
    if (!sync(file_)) fail(reason(errno));
    close();
    if (::rename(temporary_.c_str(), target_.c_str()) == 0) {
        is_committed_ = true;
        free_slot(slot_);
    } else if (replaces_ && (errno == EBUSY || errno == EPERM || errno == EACCES)) {
        overwrite();
    } else {
        fail(reason(errno));
    }
    // The new name is durable when its folder is. The file is complete, so an error here is none of its own.
    const std::string folder = fs::path(target_).parent_path().string();
    if (const Descriptor f(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)); f.is_open())
        sync(f.get());
}

// What is mounted, or belongs to another user in a folder such as /tmp, can be written but not replaced.
void OutputFile::overwrite() {
    const Descriptor from(::open(temporary_.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
    // From here on it is the only complete copy, which must outlive an interrupt.
    free_slot(slot_);
    const Descriptor to(
        from.is_open() ? ::open(target_.c_str(), O_WRONLY | O_TRUNC | O_NOFOLLOW | O_CLOEXEC) : -1);
    if (to.is_open() && copy(from.get(), to.get()) && sync(to.get())) return;
    const int error = errno;
    const std::string kept = std::exchange(temporary_, {});
    fail(fmt::format("{}; its contents are in \"{}\"", reason(error), kept));
}

void OutputFile::check(const std::string& path) {
    const OutputFile file(path);
    if (file.error_ != 0) file.fail(reason(file.error_));
}

void write_file(const std::string& path, std::string_view bytes, Links links) {
    OutputFile file(path, links);
    file.write(bytes);
    file.commit();
}

bool are_one_file(const std::string& a, const std::string& b) {
    std::error_code error;
    const fs::path to_a = follow_links(a, error), to_b = follow_links(b, error);
    if (error) return false;
    const auto is_in_place = [&](const fs::path& path) {
        return open_descriptor(path) ||
               (fs::exists(path, error) && !fs::is_regular_file(path, error));
    };
    const bool is_a_in_place = is_in_place(to_a), is_b_in_place = is_in_place(to_b);
    if (is_a_in_place && is_b_in_place) return false;
    // The descriptor of a file that the other one replaces.
    if (is_a_in_place || is_b_in_place) return fs::equivalent(to_a, to_b, error);
    const auto real = [&](const fs::path& path) {
        return fs::weakly_canonical(fs::absolute(path, error), error);
    };
    return real(to_a) == real(to_b) && !error;
}

void remove_temporary_files() noexcept {
    for (Slot& slot : slots)
        if (slot.state == Slot::Named) ::unlink(slot.name);
}

}  // namespace etendue
