#include "readers/gzip.h"

#include <algorithm>
#include <limits>

#include <zlib.h>

#include "description/source_location.h"

namespace etendue {

bool is_gzip(std::string_view bytes) {
    return bytes.size() > 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b';
}

std::string unpack_gzip(std::string_view bytes, const std::string& file) {
    constexpr size_t kMost = size_t(1) << 34;  // keeps hostile files from exhausting the memory
    constexpr size_t kStep = size_t(1) << 20;
    constexpr size_t kMostInput = std::numeric_limits<uInt>::max();
    const auto fail = [&](const char* why) {
        throw SceneError({file, 0}, std::string("cannot unpack the gzip data: ") + why);
    };
    z_stream stream{};
    constexpr int kGzipWindow = 15 + 16;
    if (inflateInit2(&stream, kGzipWindow) != Z_OK) fail("out of memory");
    std::string out;
    size_t read = 0, written = 0;
    int status = Z_OK;
    while (status == Z_OK) {
        if (written == out.size()) out.resize(out.size() + std::max(kStep, out.size() / 2));
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
        if (written > kMost) break;
    }
    inflateEnd(&stream);
    if (written > kMost) fail("there are more than 16 GiB of them");
    if (status != Z_STREAM_END) fail("they are damaged or cut short");
    out.resize(written);
    return out;
}

}  // namespace etendue
