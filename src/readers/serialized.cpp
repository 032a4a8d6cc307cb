#include "readers/serialized.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <iterator>
#include <limits>

#include <fmt/format.h>

#include "readers/file_bytes.h"
#include "system/available_memory.h"

namespace etendue {
namespace {

static_assert(std::endian::native == std::endian::little, "binary readers assume little-endian");

constexpr uint16_t kMagic = 0x041C;
constexpr uint16_t kOldVersion = 3, kVersion = 4;
constexpr size_t kMeshHeaderBytes = 4;

enum Flags : uint32_t {
    kHasNormals = 0x0001,
    kHasTexcoords = 0x0002,
    kHasColors = 0x0008,
    kFaceNormals = 0x0010,
    kSinglePrecision = 0x1000,
    kDoublePrecision = 0x2000,
};

template <class T>
T load(const char* at) {
    T value;
    std::memcpy(&value, at, sizeof(T));
    return value;
}

/// Inflates a zlib stream in pieces, so that no memory is allocated for data that the file does not contain.
class InflateStream {
public:
    InflateStream(std::string_view compressed, const SourceLocation& where) : where_(where) {
        z_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(compressed.data()));
        z_.avail_in = uInt(std::min<size_t>(compressed.size(), std::numeric_limits<uInt>::max()));
        if (inflateInit(&z_) != Z_OK) throw SceneError(where_, "cannot start decompression");
    }
    InflateStream(const InflateStream&) = delete;
    InflateStream& operator=(const InflateStream&) = delete;
    ~InflateStream() { inflateEnd(&z_); }

    void read(void* to, size_t bytes) {
        z_.next_out = static_cast<Bytef*>(to);
        z_.avail_out = uInt(bytes);
        while (z_.avail_out > 0) {
            const int status = inflate(&z_, Z_NO_FLUSH);
            if (status != Z_OK && !(status == Z_STREAM_END && z_.avail_out == 0))
                throw SceneError(where_, status == Z_DATA_ERROR ? "damaged compressed data"
                                                                : "the compressed data ends early");
        }
    }
    template <class T>
    T read() {
        T value;
        read(&value, sizeof(T));
        return value;
    }
    /// `count` items of type `Stored`, each passed through `convert`.
    template <class Stored, class Convert>
    auto read_array(uint64_t count, Convert convert) {
        constexpr uint64_t kPiece = 1 << 16;
        std::vector<decltype(convert(Stored{}))> items;
        items.reserve(std::min(count, 16 * kPiece));
        std::vector<Stored> piece;
        while (items.size() < count) {
            piece.resize(std::min(kPiece, count - items.size()));
            read(piece.data(), piece.size() * sizeof(Stored));
            std::transform(piece.begin(), piece.end(), std::back_inserter(items), convert);
        }
        return items;
    }

private:
    z_stream z_{};
    SourceLocation where_;
};

class SerializedMesh {
public:
    SerializedMesh(std::string_view compressed, uint16_t version, const SourceLocation& where)
        : in_(compressed, where), compressed_bytes_(compressed.size()), version_(version),
          where_(where) {}

    MeshData parse() {
        flags_ = in_.read<uint32_t>();
        // Old files name no precision and are in single precision.
        if ((flags_ & kSinglePrecision) && (flags_ & kDoublePrecision))
            throw SceneError(where_, "the flags name both single and double precision");
        MeshData mesh;
        if (version_ == kVersion) mesh.name = read_name();
        const uint64_t vertices = count("vertices"), triangles = count("triangles");
        check_size(vertices, triangles);
        mesh.positions = points<Vec3>(vertices);
        if (flags_ & kHasNormals) mesh.normals = points<Vec3>(vertices);
        if (flags_ & kHasTexcoords) mesh.uvs = points<Vec2>(vertices);
        if (flags_ & kHasColors) mesh.colors = points<Vec3>(vertices);
        mesh.triangles = in_.read_array<MeshData::Triangle>(
            triangles, [](const MeshData::Triangle& t) { return t; });
        mesh.face_normals = (flags_ & kFaceNormals) != 0;
        return mesh;
    }

private:
    std::string read_name() {
        constexpr size_t kLongest = 1 << 16;
        std::string name;
        for (char c = in_.read<char>(); c != 0; c = in_.read<char>()) {
            if (name.size() == kLongest)
                throw SceneError(where_, "the name of the mesh has no end");
            name += c;
        }
        return name;
    }
    /// Refuses counts of which a small file could hold nothing but zeros.
    void check_size(uint64_t vertices, uint64_t triangles) const {
        constexpr uint64_t kAlways = uint64_t(256) << 20, kMostRatio = 64;
        const uint64_t number = flags_ & kDoublePrecision ? sizeof(double) : sizeof(float);
        const uint64_t numbers = 3 + (flags_ & kHasNormals ? 3 : 0) +
                                 (flags_ & kHasTexcoords ? 2 : 0) + (flags_ & kHasColors ? 3 : 0);
        const uint64_t bytes = vertices * numbers * number + triangles * sizeof(MeshData::Triangle);
        if (bytes > std::max(kAlways, kMostRatio * compressed_bytes_))
            throw SceneError(where_,
                             fmt::format("the mesh has {} vertices and {} triangles, which is more "
                                         "than {} bytes of the file can hold",
                                         vertices, triangles, compressed_bytes_));
        if (const auto free = available_memory(); free && bytes > *free)
            throw SceneError(where_,
                             fmt::format("the mesh needs {} of memory, but only {} are free",
                                         format_bytes(bytes), format_bytes(*free)));
    }
    uint64_t count(const char* what) {
        const auto n = in_.read<uint64_t>();
        if (n > std::numeric_limits<uint32_t>::max())
            throw SceneError(where_,
                             std::to_string(n) + " " + what + " are more than 32 bits can index");
        return n;
    }
    template <class Vec>
    std::vector<Vec> points(uint64_t count) {
        constexpr size_t n = sizeof(Vec) / sizeof(float);
        const auto to_vec = [](const auto& p) {
            if constexpr (n == 2)
                return Vec2{float(p[0]), float(p[1])};
            else
                return Vec3{float(p[0]), float(p[1]), float(p[2])};
        };
        return flags_ & kDoublePrecision ? in_.read_array<std::array<double, n>>(count, to_vec)
                                         : in_.read_array<std::array<float, n>>(count, to_vec);
    }

    InflateStream in_;
    uint64_t compressed_bytes_;
    uint16_t version_;
    uint32_t flags_ = 0;
    SourceLocation where_;
};

/// Version of the mesh that begins at `offset`.
uint16_t check_mesh_header(std::string_view bytes, uint64_t offset, const SourceLocation& where) {
    if (offset > bytes.size() || bytes.size() - offset < kMeshHeaderBytes)
        throw SceneError(where, "a mesh begins beyond the end of the file");
    if (load<uint16_t>(&bytes[offset]) != kMagic)
        throw SceneError(where, "not a .serialized file: the identifier 0x041C is missing");
    const auto version = load<uint16_t>(&bytes[offset + 2]);
    if (version != kOldVersion && version != kVersion)
        throw SceneError(where, "unknown version " + std::to_string(version) +
                                    " of the format (known: 3, 4)");
    return version;
}

/// Where mesh number `shape_index` begins, from the table at the end of the file.
uint64_t mesh_offset(std::string_view bytes, int shape_index, uint16_t version,
                     const SourceLocation& where) {
    const auto meshes = load<uint32_t>(&bytes[bytes.size() - sizeof(uint32_t)]);
    const size_t entry = version == kVersion ? sizeof(uint64_t) : sizeof(uint32_t);
    const size_t body = bytes.size() - sizeof(uint32_t);
    if (meshes == 0 || meshes > body / entry)
        throw SceneError(where, "the table of meshes at the end of the file is damaged");
    if (shape_index < 0 || uint32_t(shape_index) >= meshes)
        throw SceneError(where, "there is no mesh " + std::to_string(shape_index) +
                                    ": the file has " + std::to_string(meshes) +
                                    ", counted from 0");
    const char* at = &bytes[body - entry * (meshes - uint32_t(shape_index))];
    return version == kVersion ? load<uint64_t>(at) : load<uint32_t>(at);
}

}  // namespace

MeshData parse_serialized(std::string_view bytes, const std::string& name, int shape_index,
                          const MeshOptions& options) {
    const SourceLocation where{name, 0};
    const uint16_t file_version = check_mesh_header(bytes, 0, where);
    const uint64_t offset = mesh_offset(bytes, shape_index, file_version, where);
    const uint16_t version = check_mesh_header(bytes, offset, where);
    MeshData mesh = SerializedMesh(bytes.substr(offset + kMeshHeaderBytes), version, where).parse();
    if (mesh.name.empty()) mesh.name = name;
    finish_mesh(mesh, options, where);
    return mesh;
}

MeshData read_serialized(const std::string& path, int shape_index, const MeshOptions& options) {
    return parse_serialized(read_file_bytes(path), path, shape_index, options);
}

}  // namespace etendue
