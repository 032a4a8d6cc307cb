#pragma once

#include <string>

#include "film/film.h"

namespace etendue {

/// Sends the image to the viewer tev (https://github.com/Tom94/tev) while it renders, at most once a second. A viewer that
/// goes away ends the preview, not the rendering.
class Preview {
public:
    /// `address`: tev, tev://host or tev://host:port (14158). Throws std::runtime_error where nobody listens.
    Preview(const std::string& address, const std::string& image_name, int width, int height);
    ~Preview();
    Preview(const Preview&) = delete;
    Preview& operator=(const Preview&) = delete;

    void update(const Film& film, double seconds);

private:
    void send(const std::string& payload);

    std::string name_;
    int width_, height_;
    int socket_ = -1;
    double last_ = -1;
};

}  // namespace etendue
