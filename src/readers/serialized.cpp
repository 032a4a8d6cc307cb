#include "readers/serialized.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>
#include <cstring>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>

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

/// A file of which parts are read as they are needed: scenes have a shape for each of its many meshes.
struct Parts {
    uint64_t size;
    std::function<std::string(uint64_t begin, uint64_t size)> read;
    SourceLocation where;
};

/// Version of the mesh that begins at `offset`.
uint16_t check_mesh_header(const Parts& file, uint64_t offset) {
    if (offset > file.size || file.size - offset < kMeshHeaderBytes)
        throw SceneError(file.where, "a mesh begins beyond the end of the file");
    const std::string bytes = file.read(offset, kMeshHeaderBytes);
    if (load<uint16_t>(&bytes[0]) != kMagic)
        throw SceneError(file.where, "not a .serialized file: the identifier 0x041C is missing");
    const auto version = load<uint16_t>(&bytes[2]);
    if (version != kOldVersion && version != kVersion)
        throw SceneError(file.where, "unknown version " + std::to_string(version) +
                                         " of the format (known: 3, 4)");
    return version;
}

/// Where a mesh begins and, at the latest, ends.
struct Extent {
    uint64_t begin, end;
};

/// Of mesh number `shape_index`, from the table at the end of the file.
Extent mesh_extent(const Parts& file, int shape_index, uint16_t version) {
    const uint64_t body = file.size - sizeof(uint32_t);
    const auto meshes = load<uint32_t>(file.read(body, sizeof(uint32_t)).data());
    const uint64_t entry = version == kVersion ? sizeof(uint64_t) : sizeof(uint32_t);
    if (meshes == 0 || meshes > body / entry)
        throw SceneError(file.where, "the table of meshes at the end of the file is damaged");
    if (shape_index < 0 || uint32_t(shape_index) >= meshes)
        throw SceneError(file.where, "there is no mesh " + std::to_string(shape_index) +
                                         ": the file has " + std::to_string(meshes) +
                                         ", counted from 0");
    const uint64_t table = body - entry * meshes;
    const auto begin_of = [&](uint32_t mesh) {
        const std::string at = file.read(table + entry * mesh, entry);
        return version == kVersion ? load<uint64_t>(at.data())
                                   : uint64_t(load<uint32_t>(at.data()));
    };
    Extent mesh{begin_of(uint32_t(shape_index)), file.size};
    // Meshes usually stand in the order of the table.
    if (uint32_t(shape_index) + 1 < meshes)
        if (const uint64_t next = begin_of(uint32_t(shape_index) + 1); next > mesh.begin)
            mesh.end = std::min(next, file.size);
    return mesh;
}

MeshData parse(const Parts& file, int shape_index, const MeshOptions& options) {
    const uint16_t file_version = check_mesh_header(file, 0);
    const Extent extent = mesh_extent(file, shape_index, file_version);
    const uint16_t version = check_mesh_header(file, extent.begin);
    const uint64_t begin = std::min(extent.begin + kMeshHeaderBytes, extent.end);
    const std::string bytes = file.read(begin, extent.end - begin);
    MeshData mesh = SerializedMesh(bytes, version, file.where).parse();
    if (mesh.name.empty()) mesh.name = file.where.file.str();
    finish_mesh(mesh, options, file.where);
    return mesh;
}

}  // namespace

MeshData parse_serialized(std::string_view bytes, const std::string& name, int shape_index,
                          const MeshOptions& options) {
    return parse(
        {bytes.size(),
         [bytes](uint64_t begin, uint64_t size) { return std::string(bytes.substr(begin, size)); },
         {name, 0}},
        shape_index, options);
}

MeshData read_serialized(const std::string& path, int shape_index, const MeshOptions& options) {
    const auto close = [](std::FILE* f) { std::fclose(f); };
    const std::unique_ptr<std::FILE, decltype(close)> file(std::fopen(path.c_str(), "rb"), close);
    if (!file) throw UnreadableFile(path);
    // What cannot be read may say that it is empty.
    if (std::fgetc(file.get()) == EOF && std::ferror(file.get())) throw UnreadableFile(path);
    if (fseeko(file.get(), 0, SEEK_END) != 0) throw UnreadableFile(path);
    const auto read = [&](uint64_t begin, uint64_t size) {
        if (!MemoryWatch().add(size)) throw std::bad_alloc();
        std::string bytes(size, '\0');
        if (fseeko(file.get(), off_t(begin), SEEK_SET) != 0) throw UnreadableFile(path);
        if (std::fread(bytes.data(), 1, size, file.get()) != size) throw UnreadableFile(path);
        return bytes;
    };
    return read_in_memory(path, [&] {
        return parse({uint64_t(ftello(file.get())), read, {path, 0}}, shape_index, options);
    });
}

}  // namespace etendue
