#include "alidade/live/send_queue.h"

#include <algorithm>
#include <utility>

namespace alidade::live {

void SendQueue::push(Outgoing message) {
  if (message.replaces > 0) {
    const auto older = std::ranges::find(waiting_, message.replaces, &Outgoing::replaces);
    if (older != waiting_.end()) {
      bytes_ -= older->size();
      waiting_.erase(older);
    }
  }
  bytes_ += message.size();
  waiting_.push_back(std::move(message));
  while (bytes_ > max_bytes_ && (drop_oldest(MessageKind::image) || drop_oldest(MessageKind::step))) {
  }
}

Outgoing SendQueue::pop() {
  Outgoing first = std::move(waiting_.front());
  waiting_.pop_front();
  bytes_ -= first.size();
  return first;
}

SendQueue::Dropped SendQueue::take_dropped() { return std::exchange(dropped_, {}); }

bool SendQueue::drop_oldest(MessageKind kind) {
  const auto oldest = std::ranges::find(waiting_, kind, &Outgoing::kind);
  if (oldest == waiting_.end()) return false;
  bytes_ -= oldest->size();
  (kind == MessageKind::image ? dropped_.images : dropped_.steps) += 1;
  waiting_.erase(oldest);
  return true;
}

}  // namespace alidade::live
