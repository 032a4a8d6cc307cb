#include "image/atomic_file.h"

#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>
#include <unistd.h>

namespace etendue {

namespace fs = std::filesystem;

PendingFile::PendingFile(const std::string& path) : path_(path) {
    const fs::path target(path);
    std::error_code error;
    if (fs::is_directory(target, error)) fail("there is a folder of that name");
    if (target.has_parent_path() && !fs::is_directory(target.parent_path(), error)) {
        fs::create_directories(target.parent_path(), error);
        if (error) fail("cannot create its folder: " + error.message());
    }
    temporary_ =
        target.parent_path() / fmt::format(".{}.{}", ::getpid(), target.filename().string());
}

PendingFile::~PendingFile() {
    std::error_code ignored;
    if (!committed_) fs::remove(temporary_, ignored);
}

void PendingFile::fail(std::string why) const {
    const std::string name = temporary();
    for (size_t at = 0; !name.empty() && (at = why.find(name, at)) != std::string::npos;
         at += path_.size())
        why.replace(at, name.size(), path_);
    throw std::runtime_error(fmt::format("cannot write \"{}\": {}", path_, why));
}

void PendingFile::commit() {
    std::error_code error;
    fs::rename(temporary_, path_, error);
    if (error) fail(error.message());
    committed_ = true;
}

void write_file_atomically(const std::string& path, std::string_view text) {
    PendingFile file(path);
    errno = 0;
    std::ofstream out(file.temporary(), std::ios::binary);
    out << text;
    out.close();
    if (!out) file.fail(std::generic_category().message(errno));
    file.commit();
}

}  // namespace etendue
