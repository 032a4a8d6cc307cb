#include "readers/gzip.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>
#include <zlib.h>

#include "description/source_location.h"
#include "system/available_memory.h"

namespace etendue {

bool is_gzip(std::string_view bytes) {
    return bytes.size() > 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b';
}

std::string unpack_gzip(std::string_view bytes, const std::string& file) {
    // Texts of scenes take a tenth to a hundredth; a file of a few megabytes must not exhaust the memory.
    constexpr size_t kAlways = size_t(256) << 20, kMostRatio = 200;
    const size_t most = std::max(kAlways, kMostRatio * bytes.size());
    constexpr size_t kStep = size_t(1) << 20;
    constexpr size_t kMostInput = std::numeric_limits<uInt>::max();
    const auto fail = [&](const std::string& why) {
        throw SceneError({file, 0}, "cannot unpack the gzip data: " + why);
    };
    z_stream stream{};
    constexpr int kGzipWindow = 15 + 16;
    if (inflateInit2(&stream, kGzipWindow) != Z_OK) fail("out of memory");
    std::string out;
    MemoryWatch watch;
    bool is_too_large = false;
    size_t read = 0, written = 0;
    int status = Z_OK;
    while (status == Z_OK) {
        if (written == out.size()) {
            const size_t more = std::min(std::max(kStep, out.size() / 2), most + 1 - out.size());
            is_too_large = written > most || !watch.add(out.size() + more);
            if (is_too_large) break;
            out.resize(out.size() + more);
        }
        const size_t in = std::min(bytes.size() - read, kMostInput);
        const size_t room = std::min(out.size() - written, kMostInput);
        stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data() + read));
        stream.avail_in = uInt(in);
        stream.next_out = reinterpret_cast<Bytef*>(&out[written]);
        stream.avail_out = uInt(room);
        status = inflate(&stream, Z_NO_FLUSH);
        read += in - stream.avail_in;
        written += room - stream.avail_out;
        // Another member may follow the end of one.
        if (status == Z_STREAM_END && read < bytes.size() && is_gzip(bytes.substr(read)))
            status = inflateReset(&stream);
    }
    inflateEnd(&stream);
    if (is_too_large && written > most)
        fail(fmt::format("they are more than {} times as large as the file", kMostRatio));
    if (is_too_large) fail("there is too little memory");
    if (status != Z_STREAM_END) fail("they are damaged or cut short");
    out.resize(written);
    return out;
}

}  // namespace etendue
