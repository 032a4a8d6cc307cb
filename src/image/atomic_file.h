#pragma once
// Files that appear under their name only when complete.

#include <filesystem>
#include <string>
#include <string_view>

namespace etendue {

/// A file that is written under a temporary name in the same folder. commit() renames it to `path` and replaces an
/// older file; without it the temporary file is removed. Missing folders are created. All errors are std::runtime_error
/// and name the file.
class PendingFile {
public:
    explicit PendingFile(const std::string& path);
    PendingFile(const PendingFile&) = delete;
    PendingFile& operator=(const PendingFile&) = delete;
    ~PendingFile();

    std::string temporary() const { return temporary_.string(); }  ///< Where to write.
    /// Throws; temporary() in `why` is replaced by the final name.
    [[noreturn]] void fail(std::string why) const;
    void commit();

private:
    std::string path_;
    std::filesystem::path temporary_;
    bool committed_ = false;
};

/// Writes `text` to a file through a PendingFile.
void write_file_atomically(const std::string& path, std::string_view text);

}  // namespace etendue
