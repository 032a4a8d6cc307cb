#include "readers/gltf_buffers.h"

#include <algorithm>
#include <array>
#include <cstring>

#include <fmt/format.h>

namespace etendue {
namespace {

struct ComponentType {
    int code;
    size_t bytes;
    double largest;  ///< What a normalised integer is divided by; 0 for floats.
};
constexpr ComponentType kComponentTypes[] = {{5120, 1, 127},          {5121, 1, 255},
                                             {5122, 2, 32767},        {5123, 2, 65535},
                                             {5125, 4, 4294967295.0}, {5126, 4, 0}};

struct ElementType {
    const char* name;
    size_t components;
};
constexpr ElementType kElementTypes[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}};

template <class T>
T load(const char* at) {
    T value;
    std::memcpy(&value, at, sizeof(T));
    return value;
}

double component(const ComponentType& type, const char* at) {
    switch (type.code) {
    case 5120: return load<int8_t>(at);
    case 5121: return load<uint8_t>(at);
    case 5122: return load<int16_t>(at);
    case 5123: return load<uint16_t>(at);
    case 5125: return load<uint32_t>(at);
    default: return double(load<float>(at));
    }
}

const ComponentType& component_type(const JsonValue& code) {
    if (!code) code.fail("is missing");
    const int64_t wanted = code.integer(0, 0, 1 << 20);
    for (const ComponentType& t : kComponentTypes)
        if (t.code == wanted) return t;
    code.fail(
        fmt::format("is {}, which is not a component type (5120 to 5123, 5125, 5126)", wanted));
}

std::string decode_base64(std::string_view text, const JsonValue& where) {
    std::string bytes;
    uint32_t bits = 0;
    int count = 0;
    for (const char c : text) {
        int digit;
        if (c >= 'A' && c <= 'Z')
            digit = c - 'A';
        else if (c >= 'a' && c <= 'z')
            digit = c - 'a' + 26;
        else if (c >= '0' && c <= '9')
            digit = c - '0' + 52;
        else if (c == '+' || c == '-')
            digit = 62;
        else if (c == '/' || c == '_')
            digit = 63;
        else if (c == '=')
            break;
        else
            where.fail("the data are not valid base64");
        bits = bits << 6 | uint32_t(digit);
        if (++count % 4 == 0)
            for (const int shift : {16, 8, 0}) bytes += char(bits >> shift & 255);
    }
    if (count % 4 == 2) bytes += char(bits >> 4 & 255);
    if (count % 4 == 3) {
        bytes += char(bits >> 10 & 255);
        bytes += char(bits >> 2 & 255);
    }
    return bytes;
}

constexpr int64_t kMost = int64_t(1)
                          << 40;  ///< Of bytes and counts; what is there is checked later.

}  // namespace

std::string decode_percent(std::string_view uri) {
    std::string name;
    const auto digit = [](char c) {
        return c >= '0' && c <= '9'                 ? c - '0'
               : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10
                                                    : -1;
    };
    for (size_t i = 0; i < uri.size(); ++i)
        if (uri[i] == '%' && i + 2 < uri.size() && digit(uri[i + 1]) >= 0 &&
            digit(uri[i + 2]) >= 0) {
            name += char(digit(uri[i + 1]) * 16 + digit(uri[i + 2]));
            i += 2;
        } else {
            name += uri[i];
        }
    return name;
}

struct GltfBuffers::Layout {
    const ComponentType* component;
    size_t components, count;
    bool normalized;

    size_t element_bytes() const { return component->bytes * components; }
    double value(const char* at) const {
        const double v = etendue::component(*component, at);
        if (!normalized || component->largest == 0) return v;
        return std::max(v / component->largest, -1.0);
    }
};

GltfBuffers::GltfBuffers(const JsonValue& root, std::string_view chunk, LoadFile load)
    : buffers_(root["buffers"].elements()), views_(root["bufferViews"].elements()),
      accessors_(root["accessors"].elements()), chunk_(chunk), load_(std::move(load)),
      loaded_(buffers_.size()) {}

std::string GltfBuffers::uri(const JsonValue& where) {
    const std::string text = where.text("");
    if (text.rfind("data:", 0) != 0) return load_(decode_percent(text), where);
    const size_t comma = text.find(',');
    if (comma == text.npos) where.fail("a data URI has a comma before the data");
    std::string data = decode_percent(std::string_view(text).substr(comma + 1));
    if (!std::string_view(text).substr(0, comma).ends_with(";base64")) return data;
    return decode_base64(data, where);
}

const std::string& GltfBuffers::buffer(size_t index) {
    std::optional<std::string>& bytes = loaded_[index];
    if (bytes) return *bytes;
    const JsonValue& b = buffers_[index];
    const auto length = size_t(b["byteLength"].integer(0, 0, kMost));
    if (b["uri"])
        bytes = uri(b["uri"]);
    else if (index == 0 && !chunk_.empty())
        bytes = std::string(chunk_);
    else
        b.fail("has neither a uri nor a binary chunk");
    if (!watch_.add(bytes->size())) b.fail("needs more memory than is free");
    if (bytes->size() < length)
        b.fail(fmt::format("should have {} bytes, but has {}", length, bytes->size()));
    return *bytes;
}

std::string_view GltfBuffers::view(size_t index) {
    const JsonValue& v = views_[index];
    const auto in = v["buffer"].index(buffers_.size());
    if (!in) v["buffer"].fail("is missing");
    const std::string& bytes = buffer(*in);
    const auto offset = size_t(v["byteOffset"].integer(0, 0, kMost)),
               length = size_t(v["byteLength"].integer(0, 0, kMost));
    if (offset > bytes.size() || length > bytes.size() - offset)
        v.fail(fmt::format("ends beyond the {} bytes of its buffer", bytes.size()));
    return std::string_view(bytes).substr(offset, length);
}

GltfBuffers::Layout GltfBuffers::read_layout(const JsonValue& a) const {
    const std::string type = a["type"].text("");
    for (const ElementType& t : kElementTypes)
        if (type == t.name)
            return {&component_type(a["componentType"]), t.components,
                    size_t(a["count"].integer(0, 0, kMost)), a["normalized"].flag(false)};
    a["type"].fail(fmt::format("is \"{}\", but must be SCALAR, VEC2, VEC3 or VEC4", type));
}

template <class Store>
void GltfBuffers::read(const JsonValue& a, const Layout& layout, Range range, const Store& store) {
    const size_t element = layout.element_bytes();
    const auto read_element = [&](const char* at, size_t index) {
        if (index < range.first || index >= range.end) return;
        for (size_t c = 0; c < layout.components; ++c)
            store((index - range.first) * layout.components + c,
                  layout.value(at + c * layout.component->bytes));
    };
    if (const auto in = a["bufferView"].index(views_.size())) {
        const std::string_view bytes = view(*in);
        const auto offset = size_t(a["byteOffset"].integer(0, 0, kMost));
        // Zero, of the time before glTF 2, means that elements follow each other.
        const JsonValue byte_stride = views_[*in]["byteStride"];
        const auto given = size_t(byte_stride.integer(0, 0, 1 << 20));
        if (given > 0 && given < element)
            byte_stride.fail(fmt::format("is {}, but elements have {} bytes", given, element));
        const size_t stride = given > 0 ? given : element;
        if (layout.count > 0 && (offset > bytes.size() || bytes.size() - offset < element ||
                                 (bytes.size() - offset - element) / stride < layout.count - 1))
            a.fail(fmt::format("needs more than the {} bytes of its bufferView", bytes.size()));
        for (size_t i = range.first; i < std::min(layout.count, range.end); ++i)
            read_element(&bytes[offset + i * stride], i);
    }
    const JsonValue sparse = a["sparse"];
    if (!sparse) return;
    const auto count = size_t(sparse["count"].integer(0, 0, kMost));
    const auto part = [&](const JsonValue& from, size_t bytes_each) {
        const auto in = from["bufferView"].index(views_.size());
        if (!in) from.fail("has no bufferView");
        const std::string_view bytes = view(*in);
        const auto offset = size_t(from["byteOffset"].integer(0, 0, kMost));
        if (offset > bytes.size() || (bytes.size() - offset) / bytes_each < count)
            from.fail(fmt::format("needs more than the {} bytes of its bufferView", bytes.size()));
        return bytes.substr(offset);
    };
    const ComponentType& index_type = component_type(sparse["indices"]["componentType"]);
    const std::string_view places = part(sparse["indices"], index_type.bytes),
                           values = part(sparse["values"], element);
    for (size_t i = 0; i < count; ++i) {
        const double place = component(index_type, &places[i * index_type.bytes]);
        if (!(place >= 0 && place < double(layout.count)))
            sparse["indices"].fail(
                fmt::format("has the index {} of {} elements", place, layout.count));
        read_element(&values[i * element], size_t(place));
    }
}

const JsonValue& GltfBuffers::accessor(const JsonValue& accessor_index) const {
    const auto index = accessor_index.index(accessors_.size());
    if (!index) accessor_index.fail("is missing");
    return accessors_[*index];
}

size_t GltfBuffers::count(const JsonValue& accessor_index) const {
    return read_layout(accessor(accessor_index)).count;
}

bool GltfBuffers::has_bytes(const JsonValue& accessor_index) const {
    const JsonValue& a = accessor(accessor_index);
    return a["bufferView"] || a["sparse"];
}

void GltfBuffers::require_bytes(const JsonValue& accessor_index) const {
    const JsonValue& a = accessor(accessor_index);
    if (!a["bufferView"]) a.fail("has no bufferView");
}

GltfBuffers::Values GltfBuffers::floats(const JsonValue& accessor_index, std::string_view types,
                                        Range range) {
    const JsonValue& a = accessor(accessor_index);
    const Layout layout = read_layout(a);
    if (types.find(a["type"].text("")) == types.npos)
        a["type"].fail(fmt::format("is {}, but {} needs {}", a["type"].text(""),
                                   accessor_index.path(), types));
    // Without a bufferView the values are zero, and nothing but this limits their number.
    constexpr size_t kMostZeros = 1 << 20;
    if (!a["bufferView"] && layout.count > kMostZeros)
        a.fail(fmt::format("has no bufferView, but {} elements", layout.count));
    if (const auto in = a["bufferView"].index(views_.size()); in && layout.count > view(*in).size())
        a.fail(fmt::format("needs more than the {} bytes of its bufferView", view(*in).size()));
    range.end = std::min(range.end, layout.count);
    Values v{range.end - std::min(range.first, range.end),
             layout.components,
             {},
             layout.normalized,
             layout.component->largest};
    v.numbers.resize(v.count * layout.components);
    read(a, layout, range, [&](size_t i, double x) { v.numbers[i] = float(x); });
    return v;
}

std::vector<uint32_t> GltfBuffers::indices(const JsonValue& accessor_index) {
    const JsonValue& a = accessor(accessor_index);
    const Layout layout = read_layout(a);
    if (layout.components != 1 || layout.component->largest == 0 || layout.component->code % 2 == 0)
        a.fail("indices must be unsigned integers");
    const auto in = a["bufferView"].index(views_.size());
    if (!in) a.fail("has no bufferView");
    if (layout.count > view(*in).size())
        a.fail(fmt::format("needs more than the {} bytes of its bufferView", view(*in).size()));
    std::vector<uint32_t> values(layout.count);
    read(a, layout, {}, [&](size_t i, double x) { values[i] = uint32_t(x); });
    return values;
}

}  // namespace etendue
