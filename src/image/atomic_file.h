#pragma once
// Files that are never seen half written.

#include <filesystem>
#include <string>
#include <string_view>

namespace etendue {

/// A file that takes its name, replacing an older one, only when commit() is called; until then it is written under
/// another name in the same folder, and it vanishes if it never is. Makes missing folders. All errors are
/// std::runtime_error and name the file.
class PendingFile {
public:
    explicit PendingFile(const std::string& path);
    PendingFile(const PendingFile&) = delete;
    PendingFile& operator=(const PendingFile&) = delete;
    ~PendingFile();

    std::string temporary() const { return temporary_.string(); }  ///< Where to write.
    [[noreturn]] void fail(std::string why) const;  ///< Speaks of the final name only.
    void commit();

private:
    std::string path_;
    std::filesystem::path temporary_;
    bool committed_ = false;
};

/// Writes a text file at once.
void write_file_atomically(const std::string& path, std::string_view text);

}  // namespace etendue
