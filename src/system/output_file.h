#pragma once
// The one way in which this project writes files: they appear under their name only when they are complete.

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace etendue {

/// What happens if the name of an output file is a symbolic link.
enum class Links {
    Follow,   ///< The file to which it points is written.
    Replace,  ///< The link itself is replaced, for names that come from others.
};

/// A file that is written under a temporary name in the folder of the target. commit() makes it durable and renames it,
/// so that a file of that name is either the old one or the complete new one, whatever fails, and also after a crash of
/// the machine. Without commit() the temporary file is removed. Missing folders are created. A file that is replaced
/// leaves its permissions to the new one.
///
/// A file that may be written but not replaced, such as one that is mounted, is overwritten when the temporary file is
/// complete. If that fails, the temporary file stays, and the error names it.
///
/// What is no regular file, such as /dev/null, /dev/stdout and named pipes, is written in place by commit().
///
/// All errors are std::runtime_error and name the file. An error of write() or seek() is reported by commit(), so these
/// can be called by libraries that allow no exceptions.
class OutputFile {
public:
    explicit OutputFile(const std::string& path, Links links = Links::Follow);
    OutputFile(const OutputFile&) = delete;
    OutputFile& operator=(const OutputFile&) = delete;
    ~OutputFile();

    /// Writes at the current position, which is 0 at first. Returns false after any error.
    bool write(const void* data, size_t size) noexcept;
    bool write(std::string_view bytes) noexcept { return write(bytes.data(), bytes.size()); }
    /// Moves the position, in bytes from the beginning.
    bool seek(uint64_t position) noexcept;
    uint64_t position() const { return position_; }
    /// Whether nothing has failed so far.
    bool is_good() const { return error_ == 0; }

    void commit();
    [[noreturn]] void fail(const std::string& why) const;

    /// Throws unless a file of this name can be written now. Creates missing folders, and leaves no other trace.
    static void check(const std::string& path);

private:
    /// Whether the target is no regular file and has to be written in place.
    bool is_in_place() const { return temporary_.empty(); }
    void check_in_place(const std::string& target);
    void open_temporary();
    void overwrite();
    void write_in_place();
    void close();

    std::string path_;       ///< As given, for messages.
    std::string target_;     ///< Where the file is, after links.
    std::string temporary_;  ///< In the same folder; empty if the target is written in place.
    int slot_ = -1;          ///< In the table of temporary files.
    int file_ = -1;
    bool replaces_ = false;  ///< Whether there is a file of that name.
    std::string memory_;     ///< Everything written, if the target is written in place.
    uint64_t position_ = 0;
    bool is_committed_ = false;
    int error_ = 0;  ///< The first error (errno).
};

/// Writes `bytes` as a file, through an OutputFile.
void write_file(const std::string& path, std::string_view bytes, Links links = Links::Follow);

/// Whether outputs of these names would replace each other. Links are followed, also to files that are still to be made.
/// What is written in place, such as a pipe, can be written by several, one after the other.
bool are_one_file(const std::string& a, const std::string& b);

/// Removes the temporary files of all OutputFiles of this process; for signal handlers that end it.
void remove_temporary_files() noexcept;

}  // namespace etendue
