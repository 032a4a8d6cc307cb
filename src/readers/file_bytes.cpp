#include "readers/file_bytes.h"

#include <sys/stat.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "description/scene_description.h"
#include "readers/gzip.h"

namespace etendue {

UnreadableFile::UnreadableFile(const std::string& path)
    : SceneError({path, 0}, std::string("cannot read: ") + std::strerror(errno)) {}

std::string read_file_bytes(const std::string& path) {
    const auto close = [](std::FILE* f) { std::fclose(f); };
    const std::unique_ptr<std::FILE, decltype(close)> file(std::fopen(path.c_str(), "rb"), close);
    if (!file) throw UnreadableFile(path);

    std::string bytes;
    const auto grow = [&](size_t size) {
        read_in_memory(path, [&] {
            if (!MemoryWatch().add(size)) throw std::bad_alloc();
            bytes.resize(size);
        });
    };
    size_t used = 0;
    // The size is only a hint: pipes and devices have none, and folders fail when they are read.
    struct stat status;
    if (fstat(fileno(file.get()), &status) == 0 && S_ISREG(status.st_mode))
        grow(size_t(status.st_size) + 1);
    for (;;) {
        if (used == bytes.size()) grow(bytes.size() + (size_t(1) << 16));
        const size_t got = std::fread(&bytes[used], 1, bytes.size() - used, file.get());
        if (got == 0) break;
        used += got;
    }
    if (std::ferror(file.get())) throw UnreadableFile(path);
    bytes.resize(used);
    return bytes;
}

std::optional<std::string> read_named_file(const ReadOptions& options, const std::string& path,
                                           const SourceLocation& where) {
    if (!options.read_file) return {};
    try {
        return options.read_file(path);
    } catch (const UnreadableFile& e) {
        throw SceneError(where, e.what());
    }
}

std::string_view plain_text(std::string_view text, const std::string& file) {
    constexpr std::string_view kUtf8 = "\xef\xbb\xbf", kUtf16[] = {"\xff\xfe", "\xfe\xff"};
    for (const std::string_view mark : kUtf16)
        if (text.starts_with(mark))
            throw SceneError({file, 1}, "the file is in UTF-16; save it as UTF-8");
    return text.starts_with(kUtf8) ? text.substr(kUtf8.size()) : text;
}

std::string directory_of(const std::string& file) {
    const auto directory = std::filesystem::path(file).parent_path();
    return directory.empty() ? std::string(".") : directory.string();
}

ReadOptions with_disk(ReadOptions options) {
    if (options.read_file) return options;
    options.is_disk = true;
    options.read_file = [](const std::string& path) -> std::optional<std::string> {
        std::error_code error;
        if (!std::filesystem::is_regular_file(path, error)) return {};
        return read_file_bytes(path);
    };
    return options;
}

std::string read_scene_bytes(const std::string& file, const ReadOptions& options) {
    auto bytes = options.read_file(file);
    if (!bytes) throw SceneError({file, 0}, "cannot read the scene file");
    return is_gzip(*bytes) ? unpack_gzip(*bytes, file) : *std::move(bytes);
}

}  // namespace etendue
