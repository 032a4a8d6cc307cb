#include "studio/geometry_reply.h"

#include <cstdint>

#include "studio/reply_json.h"

namespace etendue {
namespace {

using nlohmann::json;

template <class T>
void append_bytes(std::string& to, const std::vector<T>& values) {
    to.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    to.append((4 - to.size() % 4) % 4, '\0');
}

}  // namespace

std::string encode(const std::vector<DrawnShape>& shapes) {
    std::string data;
    json list = json::array();
    for (const DrawnShape& s : shapes) {
        json item{{"shape", s.shape},
                  {"name", s.name},
                  {"low", to_json(s.bounds.lo)},
                  {"high", to_json(s.bounds.hi)},
                  {"color", to_json(s.color)},
                  {"emits", s.emits},
                  {"delta", s.is_specular},
                  {"vertices", s.positions.size() / 3},
                  {"indices", s.triangles.size()},
                  {"positions_at", data.size()}};
        append_bytes(data, s.positions);
        item["indices_at"] = data.size();
        append_bytes(data, s.triangles);
        item["coarse_indices"] = s.coarse_triangles.size();
        item["coarse_at"] = data.size();
        append_bytes(data, s.coarse_triangles);
        item["places"] = s.places.size();
        item["places_at"] = data.size();
        append_bytes(data, s.places);
        list.push_back(std::move(item));
    }
    std::string text = dump(list);
    text.append((4 - text.size() % 4) % 4, ' ');
    const auto size = uint32_t(text.size());
    return std::string(reinterpret_cast<const char*>(&size), sizeof size) + text + data;
}

}  // namespace etendue
