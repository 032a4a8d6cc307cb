#pragma once

#include <string>

#include "film/film.h"

namespace etendue {

/// Sends the image to the viewer tev (https://github.com/Tom94/tev) during rendering, at most once per second. If the
/// viewer closes the connection, the preview ends and the rendering continues.
class Preview {
public:
    /// `address`: tev, tev://host or tev://host:port; port 14158 by default. Throws std::runtime_error where no viewer
    /// listens there.
    Preview(const std::string& address, const std::string& image_name, int width, int height);
    ~Preview();
    Preview(const Preview&) = delete;
    Preview& operator=(const Preview&) = delete;

    /// At most once a second. Returns false if the viewer can show no more.
    bool update(const Film& film, double seconds);

private:
    void send(const std::string& payload);

    std::string name_;
    int width_, height_;
    int socket_ = -1;
    double last_ = -1;
};

}  // namespace etendue
